//! Inputs that change: refused by whoever renders; planned again, what still holds is kept.

use std::fs;
use std::path::Path;

use super::facade::{Facade, assemble, done, files, groundel, missing, refused, render};

/// A planned and rendered job.
fn rendered(facade: &Facade, flags: &[&str]) -> std::path::PathBuf {
    let job = facade.path("job");
    done(&mut facade.plan(&job, &[flags, &["--batches", "4"]].concat()));
    done(&mut render(&job, &[]));
    job
}

/// Plans the job again with `flags`, renders what does not hold, and compares with a run from scratch. Tiles that held, and
/// all.
fn replan(facade: &Facade, job: &Path, (name, flags): (&str, &[&str])) -> (usize, usize) {
    let (_, said) = done(&mut facade.plan(job, &[flags, &["--changed"]].concat()));
    let line = said.lines().find(|line| line.ends_with("tiles still hold"));
    let line = line.unwrap_or_else(|| panic!("{said}"));
    let numbers: Vec<usize> = line.split(' ').filter_map(|word| word.parse().ok()).collect();
    let (_, told) = done(groundel().arg("render").arg(job));
    assert!(
        numbers[0] == 0 || told.contains("going on after") || numbers[0] == numbers[1],
        "{told}"
    );
    let out = facade.path(&format!("out {name}"));
    done(&mut assemble(job, &out, &[]));
    let equal: Vec<_> =
        files(&out).iter().zip(facade.ortho(name, flags)).map(|(a, b)| *a == b).collect();
    assert!(
        equal.iter().all(|e| *e),
        "{name}: {equal:?}, {} of {} tiles held",
        numbers[0],
        numbers[1]
    );
    (numbers[0], numbers[1])
}

/// Another picture in the place of a photo.
fn repaint(photo: &Path) {
    let picture = image::open(photo).unwrap().to_rgb8();
    let mut picture = image::imageops::rotate180(&picture);
    image::imageops::invert(&mut picture);
    // Other photos may be the same file by another name.
    fs::remove_file(photo).unwrap();
    picture.save(photo).unwrap();
}

#[test]
fn a_worker_refuses_inputs_that_are_not_those_of_the_plan() {
    let facade = Facade::new();
    let job = facade.path("job");
    done(&mut facade.plan(&job, &["--batches", "4"]));
    let photo = facade.path("project/photos/IMG_0004.jpg");
    let original = fs::read(&photo).unwrap();
    repaint(&photo);
    let said = refused(&mut render(&job, &[]), 2);
    assert!(
        said.contains("IMG_0004.jpg: content: expected the file that the job was planned with"),
        "{said}"
    );
    fs::write(&photo, &original[..original.len() / 2]).unwrap();
    assert!(refused(&mut render(&job, &[]), 2).contains("IMG_0004.jpg"));
    fs::remove_file(&photo).unwrap();
    assert!(refused(&mut render(&job, &[]), 2).contains("IMG_0004.jpg"));
    fs::write(&photo, &original).unwrap();
    let mesh = facade.path("project/mesh.ply");
    let whole = fs::read(&mesh).unwrap();
    let mut other = whole.clone();
    let at = other.len() / 2;
    other[at] ^= 1;
    fs::write(&mesh, other).unwrap();
    assert!(refused(&mut render(&job, &[]), 2).contains("mesh.ply: content"));
    fs::write(&mesh, whole).unwrap();
    done(&mut render(&job, &[]));
    assert_eq!(missing(&job), Vec::<u32>::new());
}

#[test]
fn after_a_photo_has_changed_only_tiles_that_it_touches_are_rendered_again() {
    let facade = Facade::street();
    let flags: &[&str] = &["--levelling", "none"];
    let job = rendered(&facade, flags);
    repaint(&facade.path("project/photos/IMG_00003.jpg"));
    let (held, all) = replan(&facade, &job, ("repainted", flags));
    assert!(held > 0 && held < all, "{held} of {all}");
    // Left out, and there again: the same tiles.
    let exclude: &[&str] = &["--levelling", "none", "--exclude", "IMG_00003.jpg"];
    assert_eq!(replan(&facade, &job, ("excluded", exclude)), (held, all));
    assert_eq!(replan(&facade, &job, ("included", flags)), (held, all));
    // Photos that are levelled together have another tone, each of them.
    let job = facade.path("job of levelled photos");
    done(&mut facade.plan(&job, &["--batches", "4"]));
    done(&mut render(&job, &[]));
    repaint(&facade.path("project/photos/IMG_00003.jpg"));
    assert_eq!(replan(&facade, &job, ("levelled", &[])), (0, all));
}

#[test]
fn after_a_mask_or_a_camera_has_changed_likewise() {
    let facade = Facade::street();
    let masks = facade.path("masks");
    fs::create_dir(&masks).unwrap();
    let draw = |name: &str, from: u32| {
        let mask = image::GrayImage::from_fn(320, 240, |x, _| {
            image::Luma([if x < from { 0 } else { 255 }])
        });
        mask.save(masks.join(format!("{name}.png"))).unwrap();
    };
    draw("IMG_00002", 50);
    draw("IMG_00025", 50);
    let flags: &[&str] = &["--levelling", "none", "--masks", masks.to_str().unwrap()];
    let job = rendered(&facade, flags);
    draw("IMG_00025", 150);
    let (held, all) = replan(&facade, &job, ("masked", flags));
    assert!(held > 0 && held < all, "{held} of {all}");
    // A camera that moves by a hand's breadth: both where it was and where it is now.
    let images = facade.path("project/sparse/images.txt");
    let text = fs::read_to_string(&images).unwrap();
    let moved: Vec<String> = text.lines().map(|line| moved(line, "IMG_00025.jpg")).collect();
    assert_ne!(moved.join("\n"), text.trim_end());
    fs::write(&images, moved.join("\n") + "\n").unwrap();
    let (held, all) = replan(&facade, &job, ("moved", flags));
    assert!(held > 0 && held < all, "{held} of {all}");
}

/// The line of `images.txt` with the photo's translation changed.
fn moved(line: &str, photo: &str) -> String {
    let mut words: Vec<String> = line.split(' ').map(str::to_owned).collect();
    if words.last().is_some_and(|name| name == photo) {
        let x: f64 = words[5].parse().unwrap();
        words[5] = (x + 0.1).to_string();
    }
    words.join(" ")
}

#[test]
fn after_anything_else_has_changed_nothing_holds() {
    let facade = Facade::new();
    let job = rendered(&facade, &[]);
    let (held, _) = replan(&facade, &job, ("sharper", &["--interpolation", "bilinear"]));
    assert_eq!(held, 0);
    // What does not reach a pixel changes nothing.
    let (_, said) = done(
        &mut facade.plan(&job, &["--interpolation", "bilinear", "--changed", "--threads", "1"]),
    );
    assert!(!said.contains("still hold"), "{said}");
    assert_eq!(missing(&job), Vec::<u32>::new());
}
