//! Parts of a job.
#![no_main]
#![allow(dead_code, reason = "each target drives one parser")]

#[path = "../../hostile/corpus.rs"]
mod corpus;
#[path = "../../hostile/parsers.rs"]
mod parsers;
mod scratch;

type Parser = fn(&std::path::Path) -> groundel::Result<u64>;

static PART: std::sync::LazyLock<std::path::PathBuf> =
    std::sync::LazyLock::new(|| corpus::part(&scratch::folder().join("job")));

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    std::fs::write(&*PART, bytes).unwrap();
    drop(parsers::part(&PART));
});
