//! The report's short form for the terminal.

use super::document::{Coverage, Report, SectionReport};
use super::photos::suspicious;

/// Photos named one by one in the summary; the JSON names them all.
const MOST_NAMED: usize = 20;

impl Report {
    /// A few lines for a person: what was made, how well it is covered, which photos were left out or are
    /// suspicious, and what it took. Each line ends in a newline.
    pub fn summary(&self) -> String {
        let mut lines = vec![self.mosaic_line()];
        if self.sections.is_empty() {
            lines.push(coverage_line(&self.coverage));
        }
        lines.extend(self.section_lines());
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
            _ if !self.sections.is_empty() => {
                format!("{} sections of {size}", self.sections.len())
            }
            Some(mosaic) => {
                format!("{}: {size}, {} MiB", mosaic.file, mosaic.bytes.div_ceil(1 << 20))
            }
            None => size,
        }
    }

    /// The sections, and those that show nothing.
    fn section_lines(&self) -> Vec<String> {
        let (shown, empty): (Vec<_>, Vec<_>) =
            self.sections.iter().partition(|section| section.coverage.with_surface > 0);
        let line = |s: &&SectionReport| format!("  {}: {}", s.file, coverage_line(&s.coverage));
        let mut lines: Vec<_> = shown.iter().take(MOST_NAMED).map(line).collect();
        lines.extend(and_more(shown.len()));
        let nothing = |s: &&SectionReport| format!("  {}: no surface, all undefined", s.file);
        lines.extend(empty.iter().take(MOST_NAMED).map(nothing));
        lines.extend(and_more(empty.len()));
        lines
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

fn coverage_line(c: &Coverage) -> String {
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
            sections: Vec::new(),
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
    fn sections_are_told_one_by_one_and_those_that_show_nothing_at_the_end() {
        let mut whole = report(0);
        let section = |(file, with): (&str, u64)| SectionReport {
            file: file.into(),
            elevation: 1.0,
            coverage: Coverage::new(1200, &[0, with], 0),
            photos: Vec::new(),
        };
        whole.sections = [("a_0m.tif", 0), ("a_1m.tif", 600)].map(section).to_vec();
        let text = whole.summary();
        let start = "2 sections of 40 × 30 pixels of 0.002 m\n  a_1m.tif: surface on 50.0 % of";
        assert!(text.starts_with(start), "{text}");
        assert!(text.contains("\n  a_0m.tif: no surface, all undefined\n4 of 4 photos"), "{text}");
    }

    #[test]
    fn a_long_list_is_cut_and_says_so() {
        let text = report(25).summary();
        assert_eq!(text.matches("left out:").count(), 20);
        assert!(text.contains("  and 5 more, see the report\n"));
    }
}
