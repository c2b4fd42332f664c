//! The report's short form for the terminal.

use super::document::Report;
use super::photos::suspicious;

/// Photos named one by one in the summary; the JSON names them all.
const MOST_NAMED: usize = 20;

impl Report {
    /// A few lines for a person: what was made, how well it is covered, which photos were left out or are
    /// suspicious, and what it took. Each line ends in a newline.
    pub fn summary(&self) -> String {
        let mut lines = vec![self.mosaic_line(), self.coverage_line()];
        lines.extend(self.mesh_line());
        lines.extend(self.left_out_lines());
        lines.extend(self.suspicious_lines());
        lines.push(self.run_line());
        lines.push(String::new());
        lines.join("\n")
    }

    fn mosaic_line(&self) -> String {
        let frame = &self.frame;
        let side = frame.pixel_size.map(|p| format!(" of {p} m")).unwrap_or_default();
        let size = format!("{} × {} pixels{side}", frame.width, frame.height);
        match self.outputs.last() {
            Some(mosaic) => {
                format!("{}: {size}, {} MiB", mosaic.file, mosaic.bytes.div_ceil(1 << 20))
            }
            None => size,
        }
    }

    fn coverage_line(&self) -> String {
        let c = &self.coverage;
        format!(
            "surface on {:.1} % of the pixels; seen by no photo {:.1} %, one {:.1} %, two {:.1} %, more {:.1} %; \
             {:.1} % of the samples rejected",
            c.percent(c.with_surface),
            c.percent(c.seen_by_none),
            c.percent(c.seen_by_one),
            c.percent(c.seen_by_two),
            c.percent(c.seen_by_more),
            100.0 * c.rejected_share,
        )
    }

    fn mesh_line(&self) -> Option<String> {
        let dropped = self.inputs.degenerate_faces_dropped;
        let unused = self.inputs.unused_non_finite_vertices;
        (dropped + unused > 0).then(|| {
            format!(
                "mesh: {dropped} faces without area dropped, {unused} unused vertices not finite"
            )
        })
    }

    fn left_out_lines(&self) -> Vec<String> {
        let cameras = &self.inputs.cameras;
        let mut lines = vec![format!("{} of {} photos used", cameras.photos_used, cameras.photos)];
        let named = cameras.left_out.iter().take(MOST_NAMED);
        lines.extend(named.map(|left| format!("  left out: {}: {}", left.photo, left.reason)));
        lines.extend(and_more(cameras.left_out.len()));
        lines
    }

    fn suspicious_lines(&self) -> Vec<String> {
        let (photos, median) = suspicious(&self.photos);
        let median = median.unwrap_or_default();
        let line = |photo: &&super::PhotoReport| {
            let residual = photo.mean_residual.unwrap_or_default();
            format!("  suspicious: {}: mean residual {residual:.1}, median {median:.1}", photo.name)
        };
        let mut lines: Vec<_> = photos.iter().take(MOST_NAMED).map(line).collect();
        lines.extend(and_more(photos.len()));
        lines
    }

    fn run_line(&self) -> String {
        let peak = self.run.peak_memory_bytes;
        let memory = peak.map(|b| format!(", peak memory {} MiB", b.div_ceil(1 << 20)));
        format!("{:.1} s{}", self.run.seconds, memory.unwrap_or_default())
    }
}

fn and_more(count: usize) -> Option<String> {
    (count > MOST_NAMED).then(|| format!("  and {} more, see the report", count - MOST_NAMED))
}

#[cfg(test)]
mod tests {
    use super::super::{
        CameraInput, Coverage, FrameSummary, Inputs, LeftOut, OutputFile, PhotoReport, PhotoTally,
        Run,
    };
    use super::*;

    fn report(left_out: usize) -> Report {
        let photo = |id: u32, residual: u64| {
            let tally = PhotoTally {
                seen: 1,
                compared: 1,
                residual_256: residual * 256,
                ..Default::default()
            };
            PhotoReport::new(id, format!("IMG_{id}.jpg"), &tally, 255.0)
        };
        let left = |i| LeftOut { photo: format!("gone_{i}.jpg"), reason: "no such file".into() };
        let cameras = CameraInput {
            photos: 4 + left_out as u64,
            photos_used: 4,
            left_out: (0..left_out).map(left).collect(),
            ..Default::default()
        };
        Report {
            groundel: "0.1.0".into(),
            inputs: Inputs { cameras, ..Inputs::default() },
            frame: FrameSummary {
                width: 40,
                height: 30,
                pixel_size: Some(0.002),
                ..Default::default()
            },
            settings: serde_json::Map::new(),
            coverage: Coverage::new(1200, &[0, 600], 0),
            photos: vec![photo(0, 3), photo(1, 3), photo(2, 30), photo(3, 3)],
            warnings: Vec::new(),
            outputs: vec![OutputFile { file: "o.tif".into(), bytes: 3 << 20 }],
            run: Run { seconds: 1.25, peak_memory_bytes: Some(5 << 20), ..Default::default() },
        }
    }

    #[test]
    fn the_summary_names_what_was_made_left_out_and_what_is_suspicious() {
        let text = report(1).summary();
        assert!(
            text.starts_with("o.tif: 40 × 30 pixels of 0.002 m, 3 MiB\nsurface on 50.0 %"),
            "{text}"
        );
        assert!(
            text.contains("\n4 of 5 photos used\n  left out: gone_0.jpg: no such file\n"),
            "{text}"
        );
        assert!(
            text.contains("  suspicious: IMG_2.jpg: mean residual 30.0, median 3.0\n"),
            "{text}"
        );
        assert_eq!(text.matches("suspicious").count(), 1);
        assert!(text.ends_with("1.2 s, peak memory 5 MiB\n"), "{text}");
    }

    #[test]
    fn a_long_list_is_cut_and_says_so() {
        let text = report(25).summary();
        assert_eq!(text.matches("left out:").count(), 20);
        assert!(text.contains("  and 5 more, see the report\n"));
    }
}
