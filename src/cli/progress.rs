//! Progress of a long stage: a bar with rate and remaining time on a terminal, else a line every 10 %.
//!
//! Where the pieces of work are known to differ, each is given a weight, and the remaining time follows the weight that is
//! left rather than the number of pieces.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
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
    Bar(ProgressBar, Weights),
    Lines(Lines),
}

/// Weight of the work that is done, and of all; nothing to go by if that is 0.
#[derive(Debug, Default)]
struct Weights {
    total: f64,
    done: Mutex<f64>,
}

impl Weights {
    fn of(total: f64) -> Self {
        Self { total: if total.is_finite() { total.max(0.0) } else { 0.0 }, done: Mutex::default() }
    }

    /// Adds to what is done; the share of all that it is then, 0 to 1, `fallback` where there are no weights.
    fn add(&self, weight: f64, fallback: f64) -> f64 {
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        *done += weight;
        if self.total > 0.0 { (*done / self.total).clamp(0.0, 1.0) } else { fallback }
    }
}

#[derive(Debug)]
struct Lines {
    name: String,
    unit: String,
    total: u64,
    done: AtomicU64,
    weights: Weights,
    started: Instant,
}

impl Progress {
    /// Progress of the stage `name` over `total` of `unit` ("tiles"), shown unless `quiet`.
    pub fn start(name: &str, unit: &str, total: u64, quiet: bool) -> Self {
        let shown = if quiet {
            Shown::Nothing
        } else if std::io::stderr().is_terminal() {
            Shown::Bar(bar(name, unit, total), Weights::default())
        } else {
            let started = Instant::now();
            Shown::Lines(Lines {
                name: name.to_string(),
                unit: unit.to_string(),
                total,
                done: AtomicU64::new(0),
                weights: Weights::default(),
                started,
            })
        };
        Self { shown }
    }

    /// The same, its remaining time told by weights, which add up to `total`.
    #[must_use]
    pub fn weighted(mut self, total: f64) -> Self {
        match &mut self.shown {
            Shown::Nothing => {}
            Shown::Bar(_, weights) | Shown::Lines(Lines { weights, .. }) => {
                *weights = Weights::of(total);
            }
        }
        self
    }

    /// `count` more are done.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`] if the process was asked to end.
    pub fn add(&self, count: u64) -> Result<()> {
        self.add_weighted(count, 0.0)
    }

    /// `count` more are done, of the weight `weight` together.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn add_weighted(&self, count: u64, weight: f64) -> Result<()> {
        match &self.shown {
            Shown::Nothing => {}
            Shown::Bar(bar, weights) => {
                bar.inc(count);
                let share = weights.add(weight, share(bar.position(), bar.length().unwrap_or(0)));
                bar.set_message(left(bar.elapsed(), share));
            }
            Shown::Lines(lines) => {
                let before = lines.done.fetch_add(count, Ordering::Relaxed);
                let after = before + count;
                let done = lines.weights.add(weight, share(after, lines.total));
                if let Some(line) = lines.line(before, after, done) {
                    console::note(&line);
                }
            }
        }
        interrupt::check()
    }

    /// The stage has ended, well or not: the bar goes away, so that what follows stands on a clean line.
    pub fn finish(self) {
        if let Shown::Bar(bar, _) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

fn share(done: u64, total: u64) -> f64 {
    done as f64 / total.max(1) as f64
}

/// The time that is left when the share `done` of the work took `elapsed`.
fn left(elapsed: Duration, done: f64) -> String {
    if done <= 0.0 {
        return "…".into();
    }
    let seconds = elapsed.as_secs_f64() * (1.0 - done) / done;
    HumanDuration(Duration::from_secs_f64(seconds.clamp(0.0, 1e9))).to_string()
}

fn bar(name: &str, unit: &str, total: u64) -> ProgressBar {
    let template = format!(
        "{{prefix}} {{wide_bar}} {{human_pos}}/{{human_len}} {unit}, {{per_sec}}, {{msg}} left"
    );
    let style =
        ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar =
        ProgressBar::new(total).with_message("…").with_style(style).with_prefix(name.to_string());
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

impl Lines {
    /// The line to write when `before` becomes `after` and the share `done` of the work is done: one if a tenth of the
    /// pieces was passed.
    fn line(&self, before: u64, after: u64, done: f64) -> Option<String> {
        let total = self.total.max(1);
        let tenths = |done: u64| u128::from(done) * u128::from(LINES) / u128::from(total);
        if tenths(after) == tenths(before) {
            return None;
        }
        let elapsed = self.started.elapsed().max(Duration::from_millis(1));
        let rate = after as f64 / elapsed.as_secs_f64();
        Some(format!(
            "{}: {} % ({after} of {} {}, {rate:.1}/s, {} left)",
            self.name,
            tenths(after) * 100 / u128::from(LINES),
            self.total,
            self.unit,
            left(elapsed, done),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(total: u64) -> Lines {
        let done = AtomicU64::new(0);
        let weights = Weights::default();
        let name = || "tiles".to_string();
        Lines { name: name(), unit: name(), total, done, weights, started: Instant::now() }
    }

    #[test]
    fn there_is_one_line_for_every_tenth() {
        let lines = lines(73);
        let written: Vec<_> = (0..73).filter_map(|done| lines.line(done, done + 1, 0.5)).collect();
        assert_eq!(written.len(), 10);
        assert!(written[4].starts_with("tiles: 50 % (37 of 73 tiles, "), "{}", written[4]);
        assert!(written[9].starts_with("tiles: 100 % (73 of 73 tiles, "), "{}", written[9]);
    }

    #[test]
    fn a_step_over_several_tenths_is_one_line_and_an_empty_stage_is_none() {
        assert!(lines(4).line(0, 3, 0.7).is_some_and(|line| line.starts_with("tiles: 70 %")));
        assert_eq!(lines(0).line(0, 0, 1.0), None);
    }

    #[test]
    fn the_time_left_follows_the_weight_of_what_is_left() {
        let weights = Weights::of(10.0);
        // One heavy piece of two, then the light one.
        let done = weights.add(9.0, 0.5);
        assert!((done - 0.9).abs() < 1e-12);
        assert_eq!(left(Duration::from_secs(90), done), "10 seconds");
        assert_eq!(left(Duration::from_secs(100), weights.add(1.0, 1.0)), "0 seconds");
        assert_eq!(left(Duration::from_secs(1), 0.0), "…");
        assert!((Weights::of(f64::NAN).add(1.0, 0.25) - 0.25).abs() < 1e-12);
    }
}
