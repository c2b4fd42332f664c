//! Point clouds of every format, by their content.
#![no_main]
#![allow(dead_code, reason = "each target drives one parser")]

#[path = "../../hostile/parsers.rs"]
mod parsers;
mod scratch;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = scratch::folder().join("input");
    std::fs::write(&path, bytes).unwrap();
    drop(parsers::points(&path));
});
