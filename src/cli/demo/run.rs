//! The demo from start to end.

use std::fs;

use super::super::args::{DemoArgs, OrthoArgs};
use super::super::config::{Config, all_processors};
use super::super::console;
use super::super::job::layer_file;
use super::super::ortho::{self, ExitStatus};
use super::{answer, preview};
use crate::geom::Size;
use crate::output::Meaning;
use crate::synthetic::{FacadeSet, PHOTOS_PER_HOUSE, StreetSet, names};
use crate::{Error, Result};

/// Writes the façade and its photos, renders them as `groundel ortho` does, draws previews and compares.
///
/// # Errors
/// What any of these gives.
pub(in crate::cli) fn run(args: &DemoArgs) -> Result<ExitStatus> {
    let threads = args.threads.unwrap_or_else(all_processors);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::io("threads", std::io::Error::other(e)))?;
    let say = |line: &str| {
        if !args.quiet {
            console::answer(&format!("{line}\n"));
        }
    };

    let set = set(args);
    say(&format!("building a façade and photographing it: {}", args.dir.display()));
    let written = pool.install(|| match street(args, &set) {
        Some(street) => street.write(&args.dir),
        None => set.write(&args.dir),
    })?;
    say(&format!("{} faces, {} photos", written.faces, written.photos));
    if args.inputs_only {
        return Ok(ExitStatus::Done);
    }

    let project = args.dir.join(names::PROJECT);
    say(&format!("rendering it: groundel ortho {}", project.display()));
    let config = Config::build(OrthoArgs {
        project: Some(project),
        report: Some(args.dir.join("report.json")),
        memory: args.memory,
        threads: args.threads,
        quiet: args.quiet,
        ..OrthoArgs::default()
    })?;
    let status = ortho::run(&config)?;

    let previews = args.dir.join("previews");
    fs::create_dir_all(&previews).map_err(|e| Error::io(&previews, e))?;
    for layer in Meaning::ALL {
        let to = previews.join(layer.name()).with_extension("png");
        let from = if layer == Meaning::Coverage { Meaning::Count } else { layer };
        preview::draw(&layer_file(&config.out, from), layer, &to)?;
    }
    say(&format!("pictures to look at: {}", previews.display()));
    let elevation = layer_file(&config.out, Meaning::Elevation);
    let answer = pool.install(|| answer::compare(&config.out, &elevation, &set))?;
    say(answer.text().trim_end());
    Ok(status)
}

/// The façade that the flags ask for.
fn set(args: &DemoArgs) -> FacadeSet {
    let set = if args.paper { FacadeSet::paper() } else { FacadeSet::demo() };
    FacadeSet { faces: args.faces.unwrap_or(set.faces), ..set }
}

/// The street that the flags ask for, if they ask for one.
fn street(args: &DemoArgs, set: &FacadeSet) -> Option<StreetSet> {
    if args.houses.is_none() && args.photos.is_none() {
        return None;
    }
    let houses = args.houses.unwrap_or(1);
    let photos = args.photos.unwrap_or(houses * PHOTOS_PER_HOUSE);
    Some(StreetSet { houses, photos, set: FacadeSet { photo: STREET_PHOTO, ..set.clone() } })
}

/// Width and height of a street's photos.
const STREET_PHOTO: Size = Size { width: 6000, height: 4000 };
