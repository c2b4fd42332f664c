//! The run report: what was read, what was left out, what the mosaic holds.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::photos::PhotoReport;
use super::stages::Stage;
use crate::plan::{Forecast, JobDemand};

/// Everything a run found. Fields are serialised in the order in which they stand here.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of groundel that made the run.
    pub groundel: String,
    /// What was read.
    pub inputs: Inputs,
    /// What the mosaic is drawn on.
    pub frame: FrameSummary,
    /// The settings that reach a pixel or a file, by their flag's name in snake case.
    pub settings: Map<String, Value>,
    /// What the mosaic's pixels show; of several sections those of the highest.
    pub coverage: Coverage,
    /// Each photo that was used, in id order; of several sections in the highest.
    pub photos: Vec<PhotoReport>,
    /// Each section, from the lowest; left out of an ordinary mosaic's report.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sections: Vec<SectionReport>,
    /// What the user should know, but what kept nothing from being done.
    pub warnings: Vec<String>,
    /// The files written, layers first.
    pub outputs: Vec<OutputFile>,
    /// How the run went: the only part that differs between runs of the same inputs and settings.
    pub run: Run,
}

/// What was read.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Inputs {
    /// The mesh files, in the order of their face ids.
    pub meshes: Vec<MeshInput>,
    /// The TIN of the point clouds, whose faces follow those of the meshes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tin: Option<TinInput>,
    /// Faces without an area, which were dropped.
    pub degenerate_faces_dropped: u64,
    /// Vertices with a coordinate that is not finite; no face uses them.
    pub unused_non_finite_vertices: u64,
    /// The camera set and its photos.
    pub cameras: CameraInput,
}

/// What a mesh file holds.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct MeshInput {
    /// The file, as it was given.
    pub file: String,
    /// Vertices.
    pub vertices: u64,
    /// Faces, polygons counted once, dropped faces counted too.
    pub faces: u64,
}

/// What was made of the point clouds.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct TinInput {
    /// The clouds, as they were given.
    pub clouds: Vec<String>,
    /// Points in the TIN.
    pub points: u64,
    /// Points that the clouds mark as withheld or as noise.
    pub passed_over: u64,
    /// Points at the place of a higher one.
    pub doubles: u64,
    /// Triangles.
    pub triangles: u64,
    /// Mean distance of neighbouring points in the plane, metres.
    pub spacing: f64,
    /// The longest edge allowed in the plane, metres; `null` if any is.
    pub max_edge: Option<f64>,
}

/// What the camera set holds.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct CameraInput {
    /// The camera set, as it was given.
    pub path: String,
    /// Photos in the set.
    pub photos: u64,
    /// Photos used.
    pub photos_used: u64,
    /// Photos that the user excluded.
    pub photos_excluded: u64,
    /// Photos that had to be left out.
    pub left_out: Vec<LeftOut>,
}

/// A photo that had to be left out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Its name in the camera set.
    pub photo: String,
    /// Why.
    pub reason: String,
}

/// What the mosaic is drawn on.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FrameSummary {
    /// "plane", "cylinder" or "perspective".
    pub kind: String,
    /// Columns.
    pub width: u64,
    /// Rows.
    pub height: u64,
    /// Metres; `None` of a perspective view.
    pub pixel_size: Option<f64>,
    /// u min, v min, u max, v max, metres; `None` of a perspective view.
    pub extent: Option<[f64; 4]>,
    /// The slab, metres; `None` where it is unbounded.
    pub elevation: [Option<f64>; 2],
    /// Coordinate reference system: "EPSG:32634".
    pub crs: Option<String>,
}

/// What the mosaic's pixels show.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Coverage {
    /// Pixels of the mosaic.
    pub pixels: u64,
    /// Pixels that show a surface.
    pub with_surface: u64,
    /// Of these, pixels that no photo sees.
    pub seen_by_none: u64,
    /// Of these, pixels that one photo sees.
    pub seen_by_one: u64,
    /// Of these, pixels that two photos see.
    pub seen_by_two: u64,
    /// Of these, pixels that more than two photos see.
    pub seen_by_more: u64,
    /// `histogram[n]`: pixels with surface that n photos see.
    pub histogram: Vec<u64>,
    /// Share of all samples that were dropped as outliers, 0 … 1; 0 if there were none.
    pub rejected_share: f64,
}

impl Coverage {
    /// The coverage of a mosaic of `pixels` pixels, from the histogram of photo counts over the pixels with
    /// surface and the number of samples dropped as outliers.
    pub fn new(pixels: u64, histogram: &[u64], rejected: u64) -> Self {
        let at = |n: usize| histogram.get(n).copied().unwrap_or(0);
        let samples: u64 = histogram.iter().zip(0..).map(|(pixels, n): (_, u64)| pixels * n).sum();
        Self {
            pixels,
            with_surface: histogram.iter().sum(),
            seen_by_none: at(0),
            seen_by_one: at(1),
            seen_by_two: at(2),
            seen_by_more: histogram.iter().skip(3).sum(),
            histogram: histogram.to_vec(),
            rejected_share: if samples == 0 { 0.0 } else { rejected as f64 / samples as f64 },
        }
    }

    /// `part` as a share of the mosaic's pixels, per cent.
    pub fn percent(&self, part: u64) -> f64 {
        100.0 * part as f64 / self.pixels.max(1) as f64
    }
}

/// One of several sections.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SectionReport {
    /// Its mosaic's file, as it was given.
    pub file: String,
    /// The elevation at which it ends, metres.
    pub elevation: f64,
    /// What its pixels show.
    pub coverage: Coverage,
    /// Each photo that was used, in id order: what became of its samples in this section, those that it shares with
    /// other sections counted.
    pub photos: Vec<PhotoReport>,
}

/// A file that was written.
#[derive(Clone, Debug, Serialize)]
pub struct OutputFile {
    /// The file, as it was given.
    pub file: String,
    /// Its size.
    pub bytes: u64,
}

/// How the run went.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Run {
    /// Threads.
    pub threads: usize,
    /// The memory cap, bytes.
    pub memory_cap_bytes: u64,
    /// The stages, in order.
    pub stages: Vec<Stage>,
    /// Wall-clock time of the whole run, seconds.
    pub seconds: f64,
    /// Greatest resident memory of the process, bytes; `None` where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    /// Who held how much of it while the tiles were rendered.
    pub memory: Vec<MemoryUse>,
    /// How much of the photos was decoded.
    pub photo_pixels: PhotoPixels,
    /// What it was forecast to take.
    pub forecast: Forecast,
    /// What was known of the job when that was reckoned.
    pub forecast_of: JobDemand,
}

/// Pixels of the photos, at their full size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PhotoPixels {
    /// In the squares of 256 pixels that tiles were rendered from, each counted once.
    pub needed: u64,
    /// Decoded from the photos' files in this run, each as often as it was; none where store files were there already.
    pub decoded: u64,
}

/// Memory of one consumer.
#[derive(Clone, Debug, Serialize)]
pub struct MemoryUse {
    /// Who: "mesh store", "photo tiles", "blocks", "finished tiles".
    pub consumer: String,
    /// Its share of the cap, bytes.
    pub share_bytes: u64,
    /// The most that it held, bytes.
    pub peak_bytes: u64,
}

impl Report {
    /// The report as indented JSON with a newline at its end.
    #[expect(clippy::missing_panics_doc, reason = "it cannot fail, as the expectation says")]
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self)
            .expect("a report has string keys and no failing fields");
        text.push('\n');
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::PhotoTally;

    fn report() -> Report {
        let tally = PhotoTally { seen: 10, compared: 10, used: 9, rejected: 1, residual_256: 2560 };
        Report {
            groundel: "0.1.0".into(),
            inputs: Inputs::default(),
            frame: FrameSummary { elevation: [None, Some(2.0)], ..Default::default() },
            settings: Map::new(),
            coverage: Coverage::new(100, &[5, 10, 20, 30, 15], 7),
            photos: vec![PhotoReport::new(3, "b/ü 1.jpg", &tally, 255.0)],
            sections: Vec::new(),
            warnings: Vec::new(),
            outputs: vec![OutputFile { file: "o.tif".into(), bytes: 12 }],
            run: Run::default(),
        }
    }

    #[test]
    fn the_histogram_is_summed_to_none_one_two_and_more() {
        let coverage = report().coverage;
        assert_eq!(coverage.with_surface, 80);
        assert_eq!((coverage.seen_by_none, coverage.seen_by_one), (5, 10));
        assert_eq!((coverage.seen_by_two, coverage.seen_by_more), (20, 45));
        assert_eq!(coverage.rejected_share.to_bits(), (7.0 / 200.0_f64).to_bits());
        assert_eq!(Coverage::new(9, &[], 0).rejected_share.to_bits(), 0);
    }

    #[test]
    fn the_json_reads_back_and_only_the_run_may_differ() {
        let json: Value = serde_json::from_str(&report().to_json()).unwrap();
        assert_eq!(json["photos"][0]["name"], "b/ü 1.jpg");
        assert_eq!(json["photos"][0]["mean_residual"], 1.0);
        assert_eq!(json["frame"]["elevation"], serde_json::json!([null, 2.0]));
        assert!(json.get("sections").is_none());
        let mut later = report();
        later.run.seconds = 12.0;
        let mut later: Value = serde_json::from_str(&later.to_json()).unwrap();
        assert_ne!(json, later);
        later["run"] = json["run"].clone();
        assert_eq!(json, later);
    }
}
