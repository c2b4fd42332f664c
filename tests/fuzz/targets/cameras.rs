//! COLMAP's camera files: the first byte chooses which of the four is fuzzed beside good ones.
#![no_main]
#![allow(dead_code, reason = "each target drives one parser")]

#[path = "../../hostile/corpus.rs"]
mod corpus;
#[path = "../../hostile/parsers.rs"]
mod parsers;
mod scratch;

type Parser = fn(&std::path::Path) -> groundel::Result<u64>;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((which, bytes)) = bytes.split_first() else { return };
    let kind = if which & 1 == 0 { "text" } else { "binary" };
    let folder = scratch::folder().join(kind);
    let names = corpus::cameras(&folder, kind);
    std::fs::write(folder.join(&names[usize::from(which >> 1 & 1)]), bytes).unwrap();
    drop(parsers::cameras(&folder));
});
