//! Point clouds become one more mesh: their TIN over the frame's plane.

use glam::DVec3;

use super::super::config::Config;
use super::super::console;
use super::super::frame_choice::FrameChoice;
use super::super::progress::Progress;
use super::disk::Room;
use super::inputs::Inputs;
use crate::Result;
use crate::frame::FrameSpec;
use crate::geom::PointSource;
use crate::input::{open_mesh, open_points};
use crate::plan::JobDemand;
use crate::render::Budget;
use crate::report::TinInput;
use crate::store::tin::{Tin, TinBuild, TinPlane};

/// The point clouds of a job, and what was made of them.
#[derive(Debug, Default)]
pub(in crate::cli) struct Clouds {
    sources: Vec<Box<dyn PointSource>>,
    tin: Option<Tin>,
}

impl Clouds {
    /// Reads the heads of the clouds.
    pub(super) fn open(config: &Config) -> Result<Self> {
        let sources = config.points.iter().map(|path| open_points(path)).collect::<Result<_>>()?;
        Ok(Self { sources, tin: None })
    }

    /// Whether there are none.
    pub(in crate::cli) fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// What the report says of them.
    pub(super) fn report(&self) -> Option<TinInput> {
        let counts = &self.tin.as_ref()?.counts;
        Some(TinInput {
            clouds: self.sources.iter().map(|s| s.path().display().to_string()).collect(),
            points: counts.points,
            passed_over: counts.passed_over,
            doubles: counts.doubles,
            triangles: counts.triangles,
            spacing: counts.spacing_m,
            max_edge: counts.max_edge_m.is_finite().then_some(counts.max_edge_m),
        })
    }
}

/// Makes the TIN of the clouds, if there are any, or opens the one that is there, and adds it to the meshes.
pub(in crate::cli) fn add_tin(config: &Config, inputs: &mut Inputs, budget: &Budget) -> Result<()> {
    let FrameChoice::Stated(FrameSpec::Plane(plane)) = &config.frame else { return Ok(()) };
    if inputs.clouds.is_empty() {
        return Ok(());
    }
    let sources: Vec<_> = inputs.clouds.sources.iter().map(AsRef::as_ref).collect();
    let mesh_temporary_bytes = TinBuild::disk_bytes(&sources);
    Room::of(config, &JobDemand { mesh_temporary_bytes, ..JobDemand::default() })?.check()?;
    let build = TinBuild {
        work: config.work.clone(),
        budget_bytes: usize::try_from(budget.build_bytes).unwrap_or(usize::MAX),
        plane: TinPlane { origin: plane.origin, u: plane.u, v: plane.v, n: plane.n },
        shift: DVec3::from_array(config.shift),
        max_edge_m: config.max_edge_m,
    };
    let progress = Progress::start("triangulation", "%", 100, config.quiet);
    let mut shown = 0;
    let built = build.open_or_build(&sources, &mut |share| {
        let percent = percent(share);
        let more = percent.saturating_sub(shown);
        shown = shown.max(percent);
        progress.add(more)
    });
    progress.finish();
    let tin = built?;
    if !config.quiet {
        console::note(&told(&tin));
    }
    inputs.meshes.push(open_mesh(&tin.path)?);
    inputs.clouds.tin = Some(tin);
    Ok(())
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 100")]
fn percent(share: f64) -> u64 {
    (100.0 * share) as u64
}

/// What was made, on one line.
fn told(tin: &Tin) -> String {
    let counts = &tin.counts;
    let besides =
        [(counts.passed_over, "withheld or noise"), (counts.doubles, "below another at its place")];
    let besides = besides.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!(", {n} {what}"));
    format!(
        "groundel: {} triangles of {} points{}; --max-edge {} (the points' mean spacing is {:.3} m)",
        counts.triangles,
        counts.points,
        besides.collect::<String>(),
        counts.max_edge_m,
        counts.spacing_m
    )
}
