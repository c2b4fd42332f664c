//! Which photos of the camera set the user wants.

/// Patterns on the photos' full names; `*` stands for any characters, `/` too, `?` for any one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PhotoChoice {
    /// Only photos that match one of these; empty: all photos.
    pub include: Vec<String>,
    /// None of the photos that match one of these.
    pub exclude: Vec<String>,
}

impl PhotoChoice {
    /// Whether the photo of this full name is wanted.
    pub fn wants(&self, name: &str) -> bool {
        let any = |patterns: &[String]| patterns.iter().any(|pattern| matches(pattern, name));
        (self.include.is_empty() || any(&self.include)) && !any(&self.exclude)
    }

    /// The pattern of `--include` or `--exclude` that matches none of `names`, if there is one: likely a mistake.
    pub fn idle_pattern(&self, names: &[String]) -> Option<&str> {
        let idle = |pattern: &&String| !names.iter().any(|name| matches(pattern, name));
        self.include.iter().chain(&self.exclude).find(idle).map(String::as_str)
    }
}

/// Whether `pattern` matches the whole of `name`: greedy, going back to the last star on a mismatch.
fn matches(pattern: &str, name: &str) -> bool {
    let pattern: Vec<char> = pattern.chars().collect();
    let name: Vec<char> = name.chars().collect();
    let (mut p, mut n) = (0, 0);
    // The last star met, and where in the name its match ends.
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                star = Some((p, n));
                p += 1;
            }
            Some(c) if *c == '?' || *c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => match star {
                Some((at, end)) => {
                    star = Some((at, end + 1));
                    p = at + 1;
                    n = end + 1;
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|c| *c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choice(include: &[&str], exclude: &[&str]) -> PhotoChoice {
        let own = |patterns: &[&str]| patterns.iter().map(|p| (*p).to_string()).collect();
        PhotoChoice { include: own(include), exclude: own(exclude) }
    }

    #[test]
    fn a_star_crosses_folders_and_the_whole_name_counts() {
        assert!(matches("left/*.jpg", "left/a/b c.jpg"));
        assert!(matches("*7100*", "left/100_7100.jpg"));
        assert!(matches("a?c", "aüc") && matches("*", "") && matches("a**b", "ab"));
        assert!(matches("*ab*ab", "ab ab ab"));
        assert!(
            !matches("left/*.jpg", "left/a.jpg.bak") && !matches("a", "ab") && !matches("?", "")
        );
        assert!(!matches("IMG*", "left/IMG_1.jpg") && !matches("img*", "IMG_1"));
    }

    #[test]
    fn many_stars_do_not_take_forever() {
        assert!(!matches(&"*a".repeat(40), &"a".repeat(39)));
    }

    #[test]
    fn exclusion_wins_over_inclusion() {
        let both = choice(&["left/*", "right/*"], &["*7100*"]);
        assert!(both.wants("left/1.jpg") && !both.wants("left/7100.jpg") && !both.wants("x.jpg"));
        assert!(choice(&[], &[]).wants("anything"));
    }

    #[test]
    fn a_pattern_that_matches_nothing_is_named() {
        let names = ["a.jpg", "b.jpg"].map(String::from);
        let idle = |choice: PhotoChoice| choice.idle_pattern(&names).map(str::to_string);
        assert_eq!(idle(choice(&["a*"], &["c*"])), Some("c*".into()));
        assert_eq!(idle(choice(&["*.jpg"], &["b*"])), None);
    }
}
