//! [`Forecast`]: what a job will take of memory, disk and time, before it begins.
//!
//! The figures are estimates: they choose no setting and reach no pixel. Time is a sum of amounts of work, each times a
//! cost that was measured on a reference machine; the caller tells how fast this machine is beside it.

use serde::Serialize;

use super::WorkAmount;

/// What a job is about to do.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct JobDemand {
    /// Threads.
    pub threads: u64,
    /// Faces of meshes whose store is not there yet.
    pub faces_to_build: u64,
    /// Bytes of the mesh store, and of temporary files while it is built; 0 if it is there.
    pub mesh_store_bytes: u64,
    /// See [`Self::mesh_store_bytes`].
    pub mesh_temporary_bytes: u64,
    /// Pixels of photos that are decoded before tiles are rendered.
    pub photo_pixels: u64,
    /// Bytes of the photo stores that are not there yet.
    pub photo_store_bytes: u64,
    /// Pixels of the mosaic; 0 if they are not known yet.
    pub mosaic_pixels: u64,
    /// Bytes of the mosaic and its layers.
    pub output_bytes: u64,
    /// What the tiles have to do.
    pub work: WorkAmount,
    /// Of the samples, those that are levelled and weighed softly.
    pub soft_samples: f64,
    /// Memory that building the mesh store, decoding the photos and rendering hold at most, bytes.
    pub held_bytes: [u64; 3],
}

/// What a job will take.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Forecast {
    /// Greatest resident memory, bytes.
    pub memory_bytes: u64,
    /// Greatest size of the work folder's new files, bytes.
    pub temporary_bytes: u64,
    /// Bytes of the mosaic and its layers.
    pub output_bytes: u64,
    /// Wall-clock time, seconds.
    pub seconds: f64,
    /// Of these, seconds for the mesh store, the photos, the tiles and the files.
    pub stages: [f64; 4],
    /// Speed of this machine beside the reference machine's, as it was measured for this.
    pub speed: f64,
}

/// Seconds of one processor of the reference machine (Intel Xeon with AVX-512, rustc 1.95) for a unit of work. They are measured by
/// `scripts/bench_scale.sh`, which writes the amounts beside the times, and fitted by `scripts/fit_forecast.py`.
mod cost {
    /// A face of a mesh store that is built.
    pub(super) const BUILT_FACE: f64 = 5.0e-7;
    /// A photo pixel decoded into memory.
    pub(super) const PHOTO_PIXEL: f64 = 1.4e-8;
    /// A photo pixel passed when an index is made, and one decoded by it while tiles are rendered.
    pub(super) const INDEXED_PIXEL: f64 = 2.0e-9;
    pub(super) const WINDOW_PIXEL: f64 = 2.75e-8;
    /// A pixel of the mosaic with a surface, encoding counted.
    pub(super) const SURFACE_PIXEL: f64 = 2.4e-8;
    /// A pixel of the mosaic in a photo: visibility, sampling, its part in the blend.
    pub(super) const SAMPLE: f64 = 6.7e-8;
    /// More for a sample that is levelled and weighed softly, with its coarse colour and its distance to the border.
    pub(super) const SOFT_SAMPLE: f64 = 4.0e-8;
    /// A face in a tile's column.
    pub(super) const FACE: f64 = 1.2e-8;
    /// A face in a photo's shaft, and one that shows in a pixel besides.
    pub(super) const FACE_VIEW: f64 = 5.0e-8;
    pub(super) const SHOWN_FACE_VIEW: f64 = 1.7e-7;
    /// A byte of output, written to a part and copied into its file; by one thread.
    pub(super) const OUTPUT_BYTE: f64 = 1.7e-9;
    /// Start and end of a job.
    pub(super) const JOB: f64 = 0.1;
}

/// Photo pixels decoded for each that is sampled: windows are cut at whole tiles, and some are decoded again.
const DECODED: f64 = 1.25;

/// Resident memory beside what is handed out: the binary, its stacks, the allocator; bytes.
const BESIDE_BYTES: u64 = 60 << 20;

impl JobDemand {
    /// What this will take on a machine that is `speed` times as fast as the reference machine.
    pub fn forecast(&self, speed: f64) -> Forecast {
        let threads = self.threads.max(1) as f64;
        let work = &self.work;
        // Photos that do not stay in memory are taken to have an index.
        let (photo_pixel, window_pixel) = if self.photo_store_bytes == 0 {
            (cost::PHOTO_PIXEL, 0.0)
        } else {
            (cost::INDEXED_PIXEL, cost::WINDOW_PIXEL)
        };
        let windows = DECODED * work.photo_pixels.min(self.photo_pixels as f64);
        let soft = self.soft_samples * cost::SOFT_SAMPLE;
        let tiles = tile_weight(work) + soft + windows * window_pixel;
        let stages = [
            self.faces_to_build as f64 * cost::BUILT_FACE / threads,
            self.photo_pixels as f64 * photo_pixel / threads,
            tiles / threads,
            self.output_bytes as f64 * cost::OUTPUT_BYTE,
        ]
        .map(|seconds| seconds / speed);
        let held = self.held_bytes.iter().max().copied().unwrap_or(0);
        Forecast {
            memory_bytes: held + BESIDE_BYTES,
            temporary_bytes: self.temporary_bytes(),
            output_bytes: self.output_bytes,
            seconds: stages.iter().sum::<f64>() + cost::JOB / speed,
            stages,
            speed,
        }
    }

    /// The work folder holds the mesh store with its temporary files; later, without these, photo stores and the part,
    /// which is as large as the output.
    pub fn temporary_bytes(&self) -> u64 {
        self.building_bytes().max(self.rendering_bytes(1))
    }

    /// The most that work folder and outputs hold together: parts stay until the files are there.
    pub fn disk_bytes(&self) -> u64 {
        self.building_bytes().max(self.rendering_bytes(2))
    }

    fn building_bytes(&self) -> u64 {
        self.mesh_store_bytes.saturating_add(self.mesh_temporary_bytes)
    }

    /// Stores and the output, so many times.
    fn rendering_bytes(&self, times: u64) -> u64 {
        let stores = self.mesh_store_bytes.saturating_add(self.photo_store_bytes);
        stores.saturating_add(self.output_bytes.saturating_mul(times))
    }
}

/// The work of tiles, photos not decoded, in seconds of one processor of the reference machine; of a tile, for the share of
/// it in the whole.
pub fn tile_weight(work: &WorkAmount) -> f64 {
    // No more faces than pixels can show.
    let shown = (work.surface_pixels / work.faces.max(1.0)).min(1.0);
    work.surface_pixels * cost::SURFACE_PIXEL
        + work.samples * cost::SAMPLE
        + work.faces * cost::FACE
        + work.face_views * (cost::FACE_VIEW + shown * cost::SHOWN_FACE_VIEW)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn demand() -> JobDemand {
        JobDemand {
            threads: 2,
            faces_to_build: 3_000_000,
            mesh_store_bytes: 48 << 20,
            mesh_temporary_bytes: 20 << 20,
            photo_pixels: 35_000_000,
            photo_store_bytes: 60 << 20,
            mosaic_pixels: 10_000_000,
            output_bytes: 22 << 20,
            work: WorkAmount {
                surface_pixels: 1e7,
                samples: 5e7,
                faces: 3e6,
                face_views: 1.5e7,
                photo_pixels: 3e7,
            },
            soft_samples: 0.0,
            held_bytes: [200 << 20, 150 << 20, 250 << 20],
        }
    }

    #[test]
    fn more_of_anything_takes_longer_and_a_faster_machine_or_more_threads_shorter() {
        let seconds = demand().forecast(1.0).seconds;
        let grown = [
            JobDemand { faces_to_build: 6_000_000, ..demand() },
            JobDemand { photo_pixels: 70_000_000, ..demand() },
            JobDemand { output_bytes: 1 << 30, ..demand() },
            JobDemand { work: WorkAmount { samples: 1e8, ..demand().work }, ..demand() },
            JobDemand { work: WorkAmount { face_views: 1e8, ..demand().work }, ..demand() },
            JobDemand { soft_samples: 5e7, ..demand() },
            JobDemand { threads: 1, ..demand() },
        ];
        assert!(grown.iter().all(|d| d.forecast(1.0).seconds > seconds));
        assert!((demand().forecast(2.0).seconds - seconds / 2.0).abs() < 1e-9);
    }

    #[test]
    fn disk_is_that_of_the_stage_that_holds_most() {
        let d = demand();
        assert_eq!(d.temporary_bytes(), (48 + 60 + 22) << 20);
        assert_eq!(d.disk_bytes(), (48 + 60 + 44) << 20);
        let d = JobDemand { mesh_temporary_bytes: 500 << 20, ..d };
        assert_eq!((d.temporary_bytes(), d.disk_bytes()), (548 << 20, 548 << 20));
        assert_eq!(d.forecast(1.0).memory_bytes, (250 << 20) + BESIDE_BYTES);
    }
}
