//! Cut into batches, rendered in any order, by anyone, from anywhere.

use std::fs;
use std::time::{Duration, SystemTime};

use super::facade::{Facade, assemble, done, files, groundel, missing, names, refused, render};

#[test]
fn any_cut_in_any_order_ends_in_the_bytes_of_one_run() {
    let facade = Facade::new();
    let whole = facade.ortho("whole", &[]);
    for (cut, threads) in [("1", "2"), ("4", "1"), ("31", "2"), ("1000000", "2")] {
        let job = facade.path(&format!("job of {cut}"));
        let (said, _) = done(&mut facade.plan(&job, &["--batches", cut, "--quiet"]));
        let batches = missing(&job);
        let count: u32 = cut.parse().unwrap();
        assert!(said.contains(&format!(" in {} batches", batches.len())), "{said}");
        assert!(batches.len() == count as usize || count > 100 && batches.len() > 100);
        // Every other one backwards, then whatever is left.
        for batch in batches.iter().rev().step_by(2).take(20) {
            done(&mut render(&job, &["--batch", &batch.to_string(), "--threads", threads]));
            assert!(!missing(&job).contains(batch));
        }
        done(&mut render(&job, &["--threads", threads, "--memory", "256MiB"]));
        assert_eq!(missing(&job), Vec::<u32>::new());
        let out = facade.path(&format!("out of {cut}"));
        done(&mut assemble(&job, &out, &["--quiet"]));
        assert!(files(&out) == whole, "{cut}");
    }
}

#[test]
fn batches_have_about_equal_work_and_follow_megapixels() {
    let facade = Facade::new();
    let job = facade.path("job");
    let (said, told) = done(&mut facade.plan(&job, &["--batch-mpx", "0.05"]));
    let (pixels, of_batch) = (765.0 * 561.0, 0.05e6);
    let count = missing(&job).len() as f64;
    assert!((count - pixels / of_batch).abs() <= 1.0, "{said}");
    // The forecast: memory, disk, time.
    for word in ["MiB of memory", "of temporary disk", "of output", "tiles in"] {
        assert!(told.contains(word) || said.contains(word), "{word}: {told}{said}");
    }
}

#[test]
fn a_finished_batch_is_not_made_again_and_a_plan_made_twice_changes_nothing() {
    let facade = Facade::new();
    let job = facade.path("job");
    done(&mut facade.plan(&job, &["--batches", "5"]));
    done(&mut render(&job, &["--batch", "2"]));
    let part = job.join("parts/batch-00002.part");
    let stamp = || (fs::read(&part).unwrap(), fs::metadata(&part).unwrap().modified().unwrap());
    let (before, manifest) = (stamp(), fs::read(job.join("manifest.json")).unwrap());
    done(&mut render(&job, &["--batch", "2"]));
    // The same plan again, in its words or without: the cut stays too.
    done(&mut facade.plan(&job, &["--batches", "5"]));
    done(&mut facade.plan(&job, &[]));
    assert!(stamp() == before && fs::read(job.join("manifest.json")).unwrap() == manifest);
    assert_eq!(missing(&job), [0, 1, 3, 4]);
    // Cut anew, its tiles count where they belong.
    done(&mut facade.plan(&job, &["--batches", "3"]));
    assert_eq!(missing(&job), [0, 1, 2]);
    let (_, said) = done(groundel().arg("render").arg(&job));
    assert!(said.contains("going on after"), "{said}");
    let out = facade.path("out");
    done(&mut assemble(&job, &out, &[]));
    assert!(files(&out) == facade.ortho("whole", &[]));
}

#[test]
fn a_job_moves_with_its_photos_or_is_told_where_they_are() {
    let facade = Facade::new();
    let whole = facade.ortho("whole", &[]);
    let job = facade.path("project/job");
    done(&mut facade.plan(&job, &["--batches", "6"]));
    done(&mut render(&job, &["--batch", "0"]));
    // Everything together.
    fs::rename(facade.path("project"), facade.path("elsewhere")).unwrap();
    let job = facade.path("elsewhere/job");
    done(&mut render(&job, &["--batch", "1"]));
    // The photos alone, as copies without their times.
    let photos = facade.path("a copy of the photos");
    fs::create_dir(&photos).unwrap();
    for name in names(&facade.path("elsewhere/photos")) {
        let to = photos.join(&name);
        fs::write(&to, fs::read(facade.path("elsewhere/photos").join(&name)).unwrap()).unwrap();
        let file = fs::File::options().write(true).open(&to).unwrap();
        file.set_modified(SystemTime::UNIX_EPOCH + Duration::from_secs(1_600_000_000)).unwrap();
    }
    fs::remove_dir_all(facade.path("elsewhere/photos")).unwrap();
    // The mesh is in its store.
    fs::remove_file(facade.path("elsewhere/mesh.ply")).unwrap();
    let said = refused(&mut render(&job, &[]), 2);
    assert!(said.contains("photos"), "{said}");
    done(&mut render(&job, &["--photos", photos.to_str().unwrap()]));
    let out = facade.path("out");
    let report = facade.path("report.json");
    done(&mut assemble(&job, &out, &["--report", report.to_str().unwrap()]));
    assert!(files(&out) == whole);
    // Tiles of all batches are in the report.
    let report = fs::read_to_string(report).unwrap();
    assert!(report.contains("\"with_surface\"") && report.contains("IMG_0001.jpg"), "{report}");
}

#[test]
fn what_is_missing_is_named_and_what_is_no_job_is_refused() {
    let facade = Facade::new();
    let job = facade.path("job");
    done(&mut facade.plan(&job, &["--batches", "12"]));
    for batch in ["0", "5", "11"] {
        done(&mut render(&job, &["--batch", batch]));
    }
    let (info, _) = done(groundel().arg("info").arg(&job));
    assert!(info.contains("batches: 12, of which 9 are missing"), "{info}");
    let out = facade.path("out");
    let said = refused(&mut assemble(&job, &out, &[]), 2);
    assert!(said.contains("9 of 12 batches are missing: 1, 2, 3, 4, 6, 7, 8, 9, 10"), "{said}");
    assert!(said.contains(" tiles: ("), "{said}");
    assert_eq!(names(&out), Vec::<String>::new());
    let said = refused(&mut render(&job, &["--batch", "12"]), 2);
    assert!(said.contains("--batch: expected a batch from 0 to 11, found 12"), "{said}");
    let said = refused(&mut render(&out, &[]), 2);
    assert!(said.contains("expected the folder of a job, found no manifest.json"), "{said}");
    // Another job in the same folder.
    let said = refused(&mut facade.plan(&job, &["--beta", "2"]), 2);
    assert!(said.contains("--changed"), "{said}");
    let text = fs::read_to_string(job.join("manifest.json")).unwrap();
    fs::write(job.join("manifest.json"), text.replace("\"batches\"", "\"batch\"")).unwrap();
    let said = refused(&mut render(&job, &[]), 2);
    assert!(said.contains("manifest.json: line "), "{said}");
}

#[test]
fn perspective_views_developments_masks_and_point_clouds_are_jobs_too() {
    let facade = Facade::new();
    let masks = facade.path("masks");
    fs::create_dir(&masks).unwrap();
    let mask =
        image::GrayImage::from_fn(640, 480, |x, _| image::Luma([if x < 200 { 0 } else { 255 }]));
    mask.save(masks.join("IMG_0003.jpg.png")).unwrap();
    let view = facade.path("view.toml");
    fs::write(&view, "kind = \"perspective\"\nphoto = \"IMG_0002.jpg\"\ndistorted = true\n")
        .unwrap();
    let drum = facade.path("drum.toml");
    let axis = "kind = \"cylinder\"\norigin = [120.0, 353.0, 61.5]\naxis = [0.0, 0.0, 1.0]\nzero = [0.0, -1.0, 0.0]\n";
    fs::write(&drum, format!("{axis}radius = 3.0\nfacing = \"outside\"\npixel_size = 0.02\n"))
        .unwrap();
    let masks = masks.to_str().unwrap();
    // A curved sheet of points half a metre before the mesh, over a part of its plane.
    let points = facade.path("sheet.txt");
    let (u, n) = ([0.939_372_712_847, 0.342_897_807_455], [0.342_897_807_455, -0.939_372_712_847]);
    let cloud = (0..4000).map(|k| {
        let (a, z) = (1.0 + f64::from(k % 80) * 0.02, 1.0 + f64::from(k / 80) * 0.02);
        let e = 0.5 + 0.05 * (3.0 * a).sin();
        let [x, y] = [0, 1].map(|i| [120.0, 350.0][i] + u[i] * a + n[i] * e);
        format!("{x} {y} {}\n", 61.5 + z)
    });
    fs::write(&points, cloud.collect::<String>()).unwrap();
    let points = points.to_str().unwrap();
    for (name, flags) in [
        ("view", ["--frame", view.to_str().unwrap(), "--exclude", "IMG_0002.jpg"]),
        ("drum", ["--frame", drum.to_str().unwrap(), "--masks", masks]),
        ("masked", ["--masks", masks, "--blend", "best"]),
        ("sheet", ["--points", points, "--beta", "1.5"]),
    ] {
        let whole = facade.ortho(name, &flags);
        let job = facade.path(&format!("job {name}"));
        done(&mut facade.plan(&job, &[&flags[..], &["--batches", "9"]].concat()));
        for batch in missing(&job).into_iter().rev() {
            done(&mut render(&job, &["--batch", &batch.to_string()]));
        }
        let out = facade.path(&format!("out {name}"));
        done(&mut assemble(&job, &out, &[]));
        assert!(files(&out) == whole, "{name}");
    }
}
