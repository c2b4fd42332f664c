//! Progress of a long stage: a bar with rate and remaining time on a terminal, else a line every 10 %.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};

use super::{console, interrupt};
use crate::Result;

/// A plain line is written each time this share of the work is done.
const LINES: u64 = 10;

/// Counts what is done of one stage; any thread may add.
#[derive(Debug)]
pub struct Progress {
    shown: Shown,
}

#[derive(Debug)]
enum Shown {
    Nothing,
    Bar(ProgressBar),
    Lines(Lines),
}

#[derive(Debug)]
struct Lines {
    name: String,
    unit: String,
    total: u64,
    done: AtomicU64,
    started: Instant,
}

impl Progress {
    /// Progress of the stage `name` over `total` of `unit` ("tiles"), shown unless `quiet`.
    pub fn start(name: &str, unit: &str, total: u64, quiet: bool) -> Self {
        let shown = if quiet {
            Shown::Nothing
        } else if std::io::stderr().is_terminal() {
            Shown::Bar(bar(name, unit, total))
        } else {
            let started = Instant::now();
            Shown::Lines(Lines {
                name: name.to_string(),
                unit: unit.to_string(),
                total,
                done: AtomicU64::new(0),
                started,
            })
        };
        Self { shown }
    }

    /// `count` more are done.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`] if the process was asked to end.
    pub fn add(&self, count: u64) -> Result<()> {
        match &self.shown {
            Shown::Nothing => {}
            Shown::Bar(bar) => bar.inc(count),
            Shown::Lines(lines) => {
                let before = lines.done.fetch_add(count, Ordering::Relaxed);
                if let Some(line) = lines.line(before, before + count) {
                    console::note(&line);
                }
            }
        }
        interrupt::check()
    }

    /// The stage has ended, well or not: the bar goes away, so that what follows stands on a clean line.
    pub fn finish(self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

fn bar(name: &str, unit: &str, total: u64) -> ProgressBar {
    let template = format!(
        "{{msg}} {{wide_bar}} {{human_pos}}/{{human_len}} {unit}, {{per_sec}}, {{eta}} left"
    );
    let style =
        ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(total).with_style(style).with_message(name.to_string());
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

impl Lines {
    /// The line to write when `before` becomes `after`: one if a tenth of the work was passed.
    fn line(&self, before: u64, after: u64) -> Option<String> {
        let total = self.total.max(1);
        let tenths = |done: u64| u128::from(done) * u128::from(LINES) / u128::from(total);
        if tenths(after) == tenths(before) {
            return None;
        }
        let seconds = self.started.elapsed().as_secs_f64().max(1e-3);
        let rate = after as f64 / seconds;
        let left = self.total.saturating_sub(after) as f64 / rate;
        Some(format!(
            "{}: {} % ({after} of {} {}, {rate:.1}/s, {} left)",
            self.name,
            tenths(after) * 100 / u128::from(LINES),
            self.total,
            self.unit,
            HumanDuration(Duration::from_secs_f64(left.min(1e9))),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(total: u64) -> Lines {
        let done = AtomicU64::new(0);
        Lines { name: "tiles".into(), unit: "tiles".into(), total, done, started: Instant::now() }
    }

    #[test]
    fn there_is_one_line_for_every_tenth() {
        let lines = lines(73);
        let written: Vec<_> = (0..73).filter_map(|done| lines.line(done, done + 1)).collect();
        assert_eq!(written.len(), 10);
        assert!(written[4].starts_with("tiles: 50 % (37 of 73 tiles, "), "{}", written[4]);
        assert!(written[9].starts_with("tiles: 100 % (73 of 73 tiles, "), "{}", written[9]);
    }

    #[test]
    fn a_step_over_several_tenths_is_one_line_and_an_empty_stage_is_none() {
        assert!(lines(4).line(0, 3).is_some_and(|line| line.starts_with("tiles: 70 %")));
        assert_eq!(lines(0).line(0, 0), None);
    }
}
