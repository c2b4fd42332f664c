//! Which photos of the camera set the user wants.

use crate::input::glob_matches;

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
        let any = |patterns: &[String]| patterns.iter().any(|pattern| glob_matches(pattern, name));
        (self.include.is_empty() || any(&self.include)) && !any(&self.exclude)
    }

    /// The pattern of `--include` or `--exclude` that matches none of `names`, if there is one: likely a mistake.
    pub fn idle_pattern(&self, names: &[String]) -> Option<&str> {
        let idle = |pattern: &&String| !names.iter().any(|name| glob_matches(pattern, name));
        self.include.iter().chain(&self.exclude).find(idle).map(String::as_str)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choice(include: &[&str], exclude: &[&str]) -> PhotoChoice {
        let own = |patterns: &[&str]| patterns.iter().map(|p| (*p).to_string()).collect();
        PhotoChoice { include: own(include), exclude: own(exclude) }
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
