//! `groundel demo` from outside: what it says about its mosaic and the known answer.

use std::process::Command;

/// The number in `text` after `words`.
fn number_after(text: &str, words: &str) -> f64 {
    let rest = &text[text.find(words).unwrap_or_else(|| panic!("{words}: {text}")) + words.len()..];
    let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
    rest[..end].parse().unwrap()
}

#[test]
fn the_demo_s_mosaic_lies_where_it_should() {
    let folder = tempfile::tempdir().unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_groundel"))
        .arg("demo")
        .arg(folder.path().join("demo"))
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let said = String::from_utf8(run.stdout).unwrap();
    assert!(number_after(&said, "shifted by ") < 0.02, "{said}");
    assert!(number_after(&said, "PSNR ") > 40.0, "{said}");
    assert!(number_after(&said, "SSIM ") > 0.99, "{said}");
    assert!(number_after(&said, "known answer: ") > 99.9, "{said}");
    assert!(number_after(&said, "surface coloured, ") > 99.99, "{said}");
    let previews = folder.path().join("demo/previews");
    assert_eq!(std::fs::read_dir(previews).unwrap().count(), 7);
}
