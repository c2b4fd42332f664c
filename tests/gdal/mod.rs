//! The independent readers: Python scripts of `tests/python` with rasterio (GDAL) and rio-cogeo.
//!
//! The environment is made by `scripts/venv.sh`. If that fails, the test fails: nothing is skipped.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::LazyLock;

use serde_json::Value;

static PYTHON: LazyLock<PathBuf> = LazyLock::new(|| {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/venv.sh");
    let output = Command::new(&script).stderr(Stdio::inherit()).output().expect("bash starts");
    assert!(output.status.success(), "{} failed: {}", script.display(), output.status);
    PathBuf::from(String::from_utf8(output.stdout).expect("a path").trim())
});

/// Runs `tests/python/<script>` with `argument` as JSON on its standard input, and returns the JSON that it prints.
///
/// # Panics
/// If the script fails; its messages stand on standard error.
pub(crate) fn python(script: &str, argument: &Value) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(script);
    let mut child = Command::new(&*PYTHON)
        .arg(&script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("python starts");
    let input = child.stdin.take().expect("a pipe");
    serde_json::to_writer(input, argument).expect("the script reads");
    let output = child.wait_with_output().expect("the script ends");
    assert!(output.status.success(), "{} failed: {}", script.display(), output.status);
    serde_json::from_slice(&output.stdout).expect("the script prints JSON")
}
