//! Holds the source tree to its architecture: the data path is the module tree.
//!
//! What is checked, on the tokens of every file under `src/` (comments cannot hide or fake anything):
//! each module names only the modules that [`TABLE`] allows; nothing unlisted lies in `src/`; the stages and
//! the vocabulary below them do no I/O, threads, clock or environment; a `mod.rs` only declares and re-exports
//! by name; no file grows past [`HARD_LINES`]; the crate page in `src/lib.rs` shows the same table.
//! Code under `#[cfg(test)]` may name what it likes. Each check is also fed a violation that it must catch.

use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// Every module, in the order of the data path, and what it may use, as the crate page says it.
const TABLE: &[(&str, &str)] = &[
    ("geom", "–"),
    ("image", "geom"),
    ("camera", "geom"),
    ("frame", "geom camera"),
    ("raster", "geom image"),
    ("synthetic", "geom image camera frame"),
    ("input", "geom camera frame"),
    ("store", "geom image camera input"),
    ("plan", "geom camera frame store"),
    ("surface", "geom image frame raster"),
    ("visibility", "geom image camera frame raster surface"),
    ("sample", "geom image visibility"),
    ("tone", "geom"),
    ("blend", "geom image sample"),
    ("output", "geom image frame"),
    ("render", "geom image camera frame store plan surface visibility sample tone blend"),
    ("batch", "geom image store plan render output"),
    ("report", "geom image plan"),
    ("cli", ALL_BUT_THE_STAGES),
];
const ALL_BUT_THE_STAGES: &str = "all but the stages";
const STAGES: &[&str] = &["surface", "visibility", "sample", "blend"];
/// Functions of values: no I/O, threads, clock or environment.
const PURE: &[&str] = &[
    "geom",
    "image",
    "camera",
    "frame",
    "raster",
    "surface",
    "visibility",
    "sample",
    "tone",
    "blend",
];
const IMPURE_STD: &[&str] = &["fs", "io", "net", "env", "process", "thread", "time"];
const IMPURE_CRATES: &[&str] = &["rayon", "crossbeam", "memmap2", "tempfile", "indicatif"];
/// Files of `src/` that are no module folder.
const ROOT_FILES: &[&str] = &["lib.rs", "main.rs", "error.rs"];
/// Code lines (neither blank nor comment) a file should and must stay under.
const SOFT_LINES: usize = 400;
const HARD_LINES: usize = 600;

/// The modules that `module` may name; empty for a module that the table does not know.
fn allowed(module: &str) -> Vec<&'static str> {
    match TABLE.iter().find(|(name, _)| *name == module) {
        Some((_, text)) if *text == ALL_BUT_THE_STAGES => {
            TABLE.iter().map(|(name, _)| *name).filter(|name| !STAGES.contains(name)).collect()
        }
        Some((_, text)) => text.split_whitespace().filter(|word| *word != "–").collect(),
        None => Vec::new(),
    }
}

/// Tokens of one level without items under `#[cfg(test)]`.
fn outside_tests(stream: TokenStream) -> Vec<TokenTree> {
    let mut kept = Vec::new();
    let mut tokens = stream.into_iter().peekable();
    while let Some(token) = tokens.next() {
        let is_hash = matches!(&token, TokenTree::Punct(p) if p.as_char() == '#');
        let marks_test = is_hash
            && matches!(tokens.peek(), Some(TokenTree::Group(g))
                if g.stream().to_string().replace(' ', "") == "cfg(test)");
        if !marks_test {
            kept.push(token);
            continue;
        }
        tokens.next();
        // The item ends with its body, or with a semicolon if it has none.
        for token in tokens.by_ref() {
            match token {
                TokenTree::Group(g) if g.delimiter() == Delimiter::Brace => break,
                TokenTree::Punct(p) if p.as_char() == ';' => break,
                _ => {}
            }
        }
    }
    kept
}

fn ident(tokens: &[TokenTree], at: usize) -> Option<String> {
    match tokens.get(at) {
        Some(TokenTree::Ident(name)) => Some(name.to_string()),
        _ => None,
    }
}

fn is_path_separator(tokens: &[TokenTree], at: usize) -> bool {
    let colon = |i: usize| matches!(tokens.get(i), Some(TokenTree::Punct(p)) if p.as_char() == ':');
    colon(at) && colon(at + 1)
}

/// Splits a `{a, b::c, …}` group at its commas.
fn branches(stream: TokenStream) -> Vec<Vec<TokenTree>> {
    let mut all = vec![Vec::new()];
    for token in stream {
        match &token {
            TokenTree::Punct(p) if p.as_char() == ',' => all.push(Vec::new()),
            _ => all.last_mut().expect("starts with one branch").push(token),
        }
    }
    all.retain(|branch| !branch.is_empty());
    all
}

/// What follows a path prefix at `at`: the first name of each branch; `super` is resolved through `ups`,
/// the number of modules left between here and the crate root (0: the names are the root's).
fn names_after(tokens: &[TokenTree], at: usize, ups: usize, found: &mut Vec<String>) {
    match tokens.get(at) {
        Some(TokenTree::Group(g)) if g.delimiter() == Delimiter::Brace => {
            for branch in branches(g.stream()) {
                names_after(&branch, 0, ups, found);
            }
        }
        Some(TokenTree::Ident(name)) if *name == "super" && is_path_separator(tokens, at + 1) => {
            names_after(tokens, at + 3, ups.saturating_sub(1), found);
        }
        Some(TokenTree::Ident(name)) if ups == 0 => found.push(name.to_string()),
        Some(TokenTree::Punct(p)) if ups == 0 && p.as_char() == '*' => found.push("*".into()),
        _ => {}
    }
}

/// Names that follow `prefix::` anywhere in `source` outside tests; `depth` is the file's module depth.
fn names_in(stream: TokenStream, prefix: &str, depth: usize, found: &mut Vec<String>) {
    let tokens = outside_tests(stream);
    for (i, token) in tokens.iter().enumerate() {
        let after_separator = i >= 2 && is_path_separator(&tokens, i - 2);
        match token {
            TokenTree::Ident(name) if is_path_separator(&tokens, i + 1) && !after_separator => {
                if *name == prefix {
                    names_after(&tokens, i + 3, 0, found);
                } else if *name == "super" && prefix == "crate" {
                    names_after(&tokens, i, depth, found);
                }
            }
            TokenTree::Group(group) => {
                let is_module = i >= 2 && ident(&tokens, i - 2).is_some_and(|word| word == "mod");
                names_in(group.stream(), prefix, depth + usize::from(is_module), found);
            }
            _ => {}
        }
    }
}

fn tokens_of(source: &str) -> TokenStream {
    source.parse().expect("the compiler accepts it")
}

/// The module a file belongs to and its depth: `geom/rect.rs` is at depth 2 of `geom`.
fn module_of(file: &Path) -> (String, usize) {
    let parts: Vec<_> = file.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    let is_mod = parts.last().is_some_and(|name| name == "mod.rs");
    (parts[0].trim_end_matches(".rs").to_string(), parts.len() - usize::from(is_mod))
}

/// What `source`, at `file` (relative to `src/`), names against the table.
fn layer_violations(file: &Path, source: &str) -> Vec<String> {
    let (module, depth) = module_of(file);
    if module == "lib" || module == "main" {
        return Vec::new();
    }
    let mut found = Vec::new();
    names_in(tokens_of(source), "crate", depth, &mut found);
    let may_use = allowed(&module);
    found.retain(|name| {
        *name != module
            && !["Error", "Result", "error"].contains(&name.as_str())
            && !may_use.contains(&name.as_str())
    });
    found.iter().map(|name| format!("{}: names crate::{name}", file.display())).collect()
}

/// I/O, threads, clock or environment in a module that has none.
fn purity_violations(file: &Path, source: &str) -> Vec<String> {
    let (module, depth) = module_of(file);
    if !PURE.contains(&module.as_str()) {
        return Vec::new();
    }
    let mut found = Vec::new();
    names_in(tokens_of(source), "std", depth, &mut found);
    found.retain(|name| IMPURE_STD.contains(&name.as_str()));
    for name in IMPURE_CRATES {
        let mut uses = Vec::new();
        names_in(tokens_of(source), name, depth, &mut uses);
        found.extend(uses.first().map(|_| (*name).to_string()));
    }
    found.iter().map(|name| format!("{}: a stage may not use {name}", file.display())).collect()
}

/// Whatever stands in a `mod.rs` (or `lib.rs`) but declarations and re-exports by name.
fn shape_violations(file: &Path, source: &str) -> Vec<String> {
    let tokens = outside_tests(tokens_of(source));
    let mut wrong = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let end = tokens[at..]
            .iter()
            .position(|t| matches!(t, TokenTree::Punct(p) if p.as_char() == ';'))
            .map_or(tokens.len(), |len| at + len + 1);
        let item = without_attributes(&tokens[at..end]);
        let keyword = item.iter().find_map(|token| match token {
            TokenTree::Ident(word) if *word != "pub" => Some(word.to_string()),
            _ => None,
        });
        match keyword.as_deref() {
            Some("use") if glob_in(item) => wrong.push("a glob re-export".to_string()),
            Some("use" | "mod") | None => {}
            Some(other) => wrong.push(format!("`{other}`")),
        }
        at = end;
    }
    wrong.iter().map(|what| format!("{}: holds {what}", file.display())).collect()
}

fn without_attributes(mut item: &[TokenTree]) -> &[TokenTree] {
    while let [TokenTree::Punct(hash), rest @ ..] = item
        && hash.as_char() == '#'
    {
        let group = rest.iter().position(|t| matches!(t, TokenTree::Group(_)));
        item = &rest[group.map_or(rest.len(), |at| at + 1)..];
    }
    item
}

fn glob_in(tokens: &[TokenTree]) -> bool {
    tokens.iter().any(|token| match token {
        TokenTree::Punct(p) => p.as_char() == '*',
        TokenTree::Group(g) => glob_in(&g.stream().into_iter().collect::<Vec<_>>()),
        _ => false,
    })
}

/// Lines that are neither blank nor comment.
fn code_lines(source: &str) -> usize {
    let mut in_block = false;
    let is_code = |line: &&str| {
        let line = line.trim();
        let starts_block = line.starts_with("/*");
        let comment = in_block || starts_block || line.starts_with("//");
        in_block = (in_block || starts_block) && !line.contains("*/");
        !line.is_empty() && !comment
    };
    source.lines().filter(is_code).count()
}

/// The crate page's rows `| [`geom`] | what it is | what it may use |`.
fn table_of_the_crate_page(page: &str) -> Vec<(String, String)> {
    let rows = page.lines().filter_map(|line| line.strip_prefix("//! | [`"));
    rows.filter_map(|row| {
        let cells: Vec<_> = row.split('|').map(str::trim).collect();
        let name = cells.first()?.split('`').next()?;
        Some((name.to_string(), (*cells.get(2)?).to_string()))
    })
    .collect()
}

fn src() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// Names of the modules that `source` declares for tests only: `#[cfg(test)] mod tests;`.
fn test_modules(source: &str) -> Vec<String> {
    let tokens: Vec<_> = tokens_of(source).into_iter().collect();
    let marks_test = |at: usize| matches!(&tokens[at], TokenTree::Group(g) if g.stream().to_string().replace(' ', "") == "cfg(test)");
    let declared = |at: usize| {
        let is_mod = ident(&tokens, at + 1).is_some_and(|word| word == "mod");
        if is_mod { ident(&tokens, at + 2) } else { None }
    };
    (0..tokens.len()).filter(|at| marks_test(*at)).filter_map(declared).collect()
}

/// The modules that are declared for tests only, as paths relative to `src/` without an ending.
fn modules_for_tests(all: &[(PathBuf, String)]) -> Vec<PathBuf> {
    let declared_in = |(declaring, source): &(PathBuf, String)| {
        let folder = match declaring.file_name().and_then(|name| name.to_str()) {
            Some("mod.rs" | "lib.rs") => declaring.with_file_name(""),
            _ => declaring.with_extension(""),
        };
        test_modules(source).into_iter().map(move |name| folder.join(name)).collect::<Vec<_>>()
    };
    all.iter().flat_map(declared_in).collect()
}

fn belongs_to(file: &Path, modules: &[PathBuf]) -> bool {
    modules.iter().any(|module| file.with_extension("") == *module || file.starts_with(module))
}

/// Every Rust file under `src/`, relative to it, with its text, sorted.
fn sources() -> Vec<(PathBuf, String)> {
    let mut folders = vec![src()];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder of src") {
            let path = entry.expect("an entry of src").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = fs::read_to_string(&path).expect("a readable source");
                files.push((path.strip_prefix(src()).expect("under src").to_path_buf(), text));
            }
        }
    }
    files.sort();
    files
}

fn violations(check: fn(&Path, &str) -> Vec<String>) -> Vec<String> {
    let all = sources();
    let for_tests = modules_for_tests(&all);
    let product = all.iter().filter(|(file, _)| !belongs_to(file, &for_tests));
    product.flat_map(|(file, source)| check(file, source)).collect()
}

#[test]
fn each_module_names_only_what_the_table_allows() {
    assert_eq!(violations(layer_violations), Vec::<String>::new());
}

#[test]
fn stages_do_no_input_or_output() {
    assert_eq!(violations(purity_violations), Vec::<String>::new());
}

#[test]
fn a_mod_file_only_declares_and_re_exports_by_name() {
    let check = |file: &Path, source: &str| match file.file_name() {
        Some(name) if name == "mod.rs" || name == "lib.rs" => shape_violations(file, source),
        _ => Vec::new(),
    };
    assert_eq!(violations(check), Vec::<String>::new());
}

#[test]
fn nothing_unlisted_lies_in_src() {
    let mut found: Vec<_> = fs::read_dir(src())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    found.sort();
    let mut listed: Vec<_> = TABLE.iter().map(|(name, _)| *name).collect();
    listed.extend(ROOT_FILES);
    listed.sort_unstable();
    assert_eq!(found, listed);
}

#[test]
fn files_stay_readable() {
    for (file, source) in sources() {
        let lines = code_lines(&source);
        assert!(lines <= HARD_LINES, "src/{} has {lines} code lines", file.display());
        if lines > SOFT_LINES {
            println!("src/{} has {lines} code lines: split it", file.display());
        }
    }
}

#[test]
fn the_crate_page_shows_the_table() {
    let page = fs::read_to_string(src().join("lib.rs")).unwrap();
    let expected: Vec<_> = TABLE.iter().map(|(a, b)| ((*a).into(), (*b).into())).collect();
    assert_eq!(table_of_the_crate_page(&page), expected);
}

#[test]
fn a_module_uses_only_modules_earlier_in_the_table() {
    for (i, (name, _)) in TABLE.iter().enumerate() {
        for used in allowed(name).into_iter().filter(|used| used != name) {
            let at = TABLE.iter().position(|(other, _)| *other == used);
            assert!(at.is_some_and(|at| at < i), "{name} uses {used}");
        }
    }
}

/// Violations of `source` at `file`, without the file's name.
fn caught(check: fn(&Path, &str) -> Vec<String>, file: &str, source: &str) -> Vec<String> {
    let strip = |text: String| text.rsplit(": ").next().unwrap_or_default().to_string();
    check(Path::new(file), source).into_iter().map(strip).collect()
}

#[test]
fn a_forbidden_module_is_found_however_it_is_written() {
    for source in [
        "use crate::store::MeshStore;",
        "use crate::{geom::{Bounds2, Bounds3}, store::{self, photo::Photo}};",
        "use crate::{\n    Error,\n    // a comment\n    store,\n};",
        "fn f() -> u8 { g(crate::store::f(), [1]) }",
        "use super::super::store::X;",
        "use super::{Sample, super::store::X};",
        "mod inner { fn f() { super::super::super::store::f() } }",
        "macro_rules! m { () => { $crate::store::f() } }",
        "#[cfg(test)] mod tests { use crate::camera::A; } use crate::store::B;",
    ] {
        let found = caught(layer_violations, "blend/mean.rs", source);
        assert_eq!(found, ["names crate::store"], "{source}");
    }
    assert_eq!(caught(layer_violations, "blend/mod.rs", "use super::store::X;").len(), 1);
    assert_eq!(caught(layer_violations, "error.rs", "use crate::geom::Size;").len(), 1);
    assert_eq!(caught(layer_violations, "cli/ortho.rs", "use crate::blend::X;").len(), 1);
    assert_eq!(caught(layer_violations, "blend/mean.rs", "use crate::*;"), ["names crate::*"]);
}

#[test]
fn what_the_table_allows_passes() {
    for source in [
        "use crate::{Error, Result, geom::Size, image::{Image, ImageView}};",
        "use super::super::geom::Size;",
        "mod inner { use super::super::sigma::X; }",
        "// crate::store\n/// [`crate::store`]\nfn f() { g(\"crate::store::X\"); }",
        "#[cfg(test)]\nmod tests { use crate::store::X; use super::super::super::plan::Y; }",
        "#[cfg(test)] use crate::store::X;",
        "fn f() { crate::blend::g(crate::sample::h) } pub(crate) struct S;",
        "use other::crate_store::store;",
    ] {
        let found = caught(layer_violations, "blend/mean.rs", source);
        assert_eq!(found, Vec::<String>::new(), "{source}");
    }
}

#[test]
fn files_of_test_modules_are_exempt_and_no_others() {
    let declaring = "mod mean;\n#[cfg(test)]\nmod tests;\n#[cfg(test)] mod scenes;".to_string();
    let inner = "mod sigma;\n#[cfg(test)]\nmod cases;".to_string();
    let all = [("blend/mod.rs".into(), declaring), ("blend/mean.rs".into(), inner)];
    let modules = modules_for_tests(&all);
    for file in
        ["blend/tests.rs", "blend/scenes/mod.rs", "blend/scenes/a.rs", "blend/mean/cases.rs"]
    {
        assert!(belongs_to(Path::new(file), &modules), "{file}");
    }
    for file in ["blend/mean.rs", "blend/mean/sigma.rs", "plan/tests.rs", "blend/tests_too.rs"] {
        assert!(!belongs_to(Path::new(file), &modules), "{file}");
    }
}

#[test]
fn a_stage_that_does_input_or_output_is_found() {
    for (source, what) in [
        ("use std::{fmt, fs::File};", "a stage may not use fs"),
        ("fn f() { std::thread::yield_now() }", "a stage may not use thread"),
        ("use rayon::prelude::*;", "a stage may not use rayon"),
    ] {
        assert_eq!(caught(purity_violations, "surface/tile.rs", source), [what]);
    }
    assert!(caught(purity_violations, "surface/tile.rs", "use std::{f64, fmt};").is_empty());
    assert!(caught(purity_violations, "store/mesh.rs", "use std::fs;").is_empty());
}

#[test]
fn code_in_a_mod_file_is_found() {
    for (source, what) in [
        ("mod a;\npub use a::*;", "holds a glob re-export"),
        ("mod a;\npub use a::{B, c::*};", "holds a glob re-export"),
        ("//! Doc.\nmod a;\n/// Doc.\npub(crate) fn f() {}", "holds `fn`"),
        ("impl A { }", "holds `impl`"),
        ("#[derive(Debug)]\npub struct A;", "holds `struct`"),
        ("mod a;\npub const N: usize = 1;", "holds `const`"),
    ] {
        assert_eq!(caught(shape_violations, "geom/mod.rs", source), [what], "{source}");
    }
    let fine = "//! Doc.\n#![expect(unsafe_code, reason = \"x\")]\nmod a;\n#[cfg(unix)]\npub mod b;\n\
                pub use a::{B, C};\n#[cfg(test)]\nmod tests { fn f() {} }";
    assert_eq!(caught(shape_violations, "geom/mod.rs", fine), Vec::<String>::new());
}

#[test]
fn code_lines_are_neither_blank_nor_comment() {
    assert_eq!(code_lines("//! a\n\nfn f() {\n    // b\n    g(); // c\n}\n/* d\n e */\n"), 3);
}

#[test]
fn a_row_of_the_crate_page_is_read() {
    let page =
        "//! | module | is | uses |\n//! |---|---|---|\n//! | [`image`] | buffers | geom |\n";
    assert_eq!(table_of_the_crate_page(page), [("image".into(), "geom".into())]);
}
