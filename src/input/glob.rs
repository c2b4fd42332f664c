//! [`glob_matches`]: the patterns of `--include` and `--exclude`.

/// Whether the whole of `name` matches `pattern`: `*` stands for any characters, `/` among them, `?` for one character,
/// every other character for itself.
///
/// Only the last `*` met is ever taken up again (an earlier one has matched all it must), so the time is at most the
/// product of the two lengths, and there is no recursion.
pub fn glob_matches(pattern: &str, name: &str) -> bool {
    let pattern: Vec<char> = pattern.chars().collect();
    let name: Vec<char> = name.chars().collect();
    let (mut p, mut n) = (0, 0);
    // Where to go on after a mismatch: behind the last star, with one more character given to it.
    let mut retry = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                p += 1;
                retry = Some((p, n + 1));
            }
            Some(&c) if c == '?' || c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => match retry {
                Some((after_star, from)) => {
                    (p, n) = (after_star, from);
                    retry = Some((after_star, from + 1));
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    /// The definition, by recursion.
    fn by_definition(pattern: &[char], name: &[char]) -> bool {
        match (pattern.split_first(), name.split_first()) {
            (None, None) => true,
            (Some(('*', rest)), _) => {
                (0..=name.len()).any(|skip| by_definition(rest, &name[skip..]))
            }
            (Some((p, ps)), Some((n, ns))) => (*p == '?' || p == n) && by_definition(ps, ns),
            _ => false,
        }
    }

    #[test]
    fn a_star_crosses_folders_and_a_question_mark_is_one_character() {
        assert!(glob_matches("west/*.jpg", "west/a/b c.jpg"));
        assert!(glob_matches("*", "") && glob_matches("", ""));
        assert!(glob_matches("IMG_00?7.JPG", "IMG_0017.JPG"));
        assert!(glob_matches("caf?", "café"));
        assert!(!glob_matches("west/*.jpg", "east/a.jpg"));
        assert!(!glob_matches("*.jpg", "a.jpg.bak") && !glob_matches("a.jpg", "A.JPG"));
        assert!(!glob_matches("?", "") && !glob_matches("", "a"));
    }

    #[test]
    fn a_pattern_of_many_stars_ends_soon() {
        let pattern = "*a".repeat(200) + "b";
        assert!(!glob_matches(&pattern, &"a".repeat(20_000)));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 5000, failure_persistence: None, rng_seed: RngSeed::Fixed(3), ..ProptestConfig::default() })]

        #[test]
        fn it_agrees_with_the_definition(pattern in "[ab*?]{0,8}", name in "[ab/]{0,10}") {
            let chars = |s: &str| s.chars().collect::<Vec<_>>();
            prop_assert_eq!(glob_matches(&pattern, &name), by_definition(&chars(&pattern), &chars(&name)));
        }
    }
}
