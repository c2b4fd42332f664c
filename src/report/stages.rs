//! Time and peak memory of the stages of a run, in the order in which they ran.

use std::time::Instant;

use serde::Serialize;

use super::memory::peak_resident_bytes;

/// What one stage took.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    /// The stage: "mesh store", "tiles".
    pub name: String,
    /// Wall-clock time, seconds.
    pub seconds: f64,
    /// Greatest resident memory of the process up to the end of the stage, bytes; `None` where the system does
    /// not tell.
    pub peak_memory_bytes: Option<u64>,
}

/// Runs stages and notes what they took.
#[derive(Debug)]
pub struct StageLog {
    started: Instant,
    stages: Vec<Stage>,
}

impl StageLog {
    /// A log that counts from now.
    pub fn start() -> Self {
        Self { started: Instant::now(), stages: Vec::new() }
    }

    /// Runs `work` as the stage `name` and returns what it returns; a failed stage is noted too.
    pub fn run<T>(&mut self, name: &str, work: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let result = work();
        self.stages.push(Stage {
            name: name.to_string(),
            seconds: begun.elapsed().as_secs_f64(),
            peak_memory_bytes: peak_resident_bytes(),
        });
        result
    }

    /// Adds the stages of another log, which ran within this one's time.
    pub fn extend(&mut self, other: &Self) {
        self.stages.extend_from_slice(&other.stages);
    }

    /// The stages so far, in order.
    pub fn stages(&self) -> &[Stage] {
        &self.stages
    }

    /// Wall-clock time since the start, seconds.
    pub fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use std::{thread, time::Duration};

    use super::*;

    #[test]
    fn stages_stand_in_the_order_they_ran_with_their_time() {
        let mut log = StageLog::start();
        let answer = log.run("first", || {
            thread::sleep(Duration::from_millis(20));
            42
        });
        log.run("second", || ());
        let names: Vec<_> = log.stages().iter().map(|s| s.name.as_str()).collect();
        assert_eq!((answer, names), (42, vec!["first", "second"]));
        assert!(log.stages()[0].seconds >= 0.02 && log.seconds() >= log.stages()[0].seconds);
    }
}
