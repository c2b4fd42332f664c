//! The memory probe: what this process holds, and what the machine has.
//!
//! Linux tells through `/proc` and the control group's files; elsewhere every answer is `None`. The only file of
//! the report that knows an operating system.

use std::fs;

/// Greatest resident memory of this process so far, in bytes (`VmHWM`).
pub fn peak_resident_bytes() -> Option<u64> {
    status_bytes("VmHWM:")
}

/// Resident memory of this process now, in bytes (`VmRSS`).
pub fn resident_bytes() -> Option<u64> {
    status_bytes("VmRSS:")
}

/// Memory that this process can hope for, in bytes: the machine's, or its control group's if that is less.
pub fn physical_bytes() -> Option<u64> {
    let machine = kib_field(&read("/proc/meminfo")?, "MemTotal:")?;
    Some(control_group_bytes().map_or(machine, |group| group.min(machine)))
}

fn status_bytes(field: &str) -> Option<u64> {
    kib_field(&read("/proc/self/status")?, field)
}

/// The least limit of this process's control groups, of version 1 or 2, up to the root; none if there is no limit.
fn control_group_bytes() -> Option<u64> {
    limit_files(&read("/proc/self/cgroup")?)
        .iter()
        .filter_map(|file| read(file)?.trim().parse::<u64>().ok())
        .min()
}

/// The files that state the limits of the groups in `/proc/self/cgroup`. In a container the folders may be mounted as
/// its root, so that a file is missing; those of its parents are asked too.
fn limit_files(membership: &str) -> Vec<String> {
    let mut files = Vec::new();
    for line in membership.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let (root, name) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            list if list.split(',').any(|c| c == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => continue,
        };
        let mut path = path.trim_end_matches('/');
        loop {
            files.push(format!("{root}{path}/{name}"));
            let Some((parent, _)) = path.rsplit_once('/') else { break };
            path = parent;
        }
    }
    files
}

fn read(path: &str) -> Option<String> {
    fs::read_to_string(path).ok()
}

/// The value of a line `field   123 kB`, in bytes.
fn kib_field(text: &str, field: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(field))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_in_kilobytes_is_read_in_bytes() {
        let status = "VmPeak:\t  20 kB\nVmHWM:\t  12 kB\nVmRSS:\t   7 kB\n";
        assert_eq!(kib_field(status, "VmHWM:"), Some(12 * 1024));
        assert_eq!(kib_field(status, "VmSwap:"), None);
        assert_eq!(kib_field("VmHWM: many kB", "VmHWM:"), None);
    }

    #[test]
    fn limits_are_looked_for_in_both_versions_of_control_groups_and_in_all_parents() {
        let found = limit_files("5:cpu:/x\n4:memory:/job/a\n0::/\n");
        let expected = [
            "/sys/fs/cgroup/memory/job/a/memory.limit_in_bytes",
            "/sys/fs/cgroup/memory/job/memory.limit_in_bytes",
            "/sys/fs/cgroup/memory/memory.limit_in_bytes",
            "/sys/fs/cgroup/memory.max",
        ];
        assert_eq!(found, expected);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_peak_counts_memory_that_was_touched() {
        let before = resident_bytes().unwrap();
        let block = vec![1_u8; 64 << 20];
        assert!(block.iter().map(|b| u64::from(*b)).sum::<u64>() == 64 << 20);
        let peak = peak_resident_bytes().unwrap();
        assert!(peak >= (60 << 20), "peak {peak}, before {before}");
        assert!(physical_bytes().unwrap() > peak);
    }
}
