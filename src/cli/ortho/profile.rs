//! The colour profile of the mosaic: that of the photos, if they agree.

use std::path::Path;

use crate::Result;
use crate::camera::Photo;
use crate::image::Colour;
use crate::input::photo::{Profile, profile_channels, read_photo_header, read_profile};

/// The profile that all photos carry, and warnings about those that keep the mosaic from carrying one.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct CommonProfile {
    pub(super) profile: Option<Vec<u8>>,
    pub(super) warnings: Vec<String>,
}

impl CommonProfile {
    /// Reads the profiles of the photos in `folder` from their files; two of them are held at a time. Samples are
    /// never converted: the mosaic has one only if every photo has the same, byte for byte, and it is one for
    /// `colour`.
    ///
    /// # Errors
    /// If a photo's file cannot be read.
    pub(super) fn of(folder: &Path, photos: &[Photo], colour: Colour) -> Result<Self> {
        let mut survey = Survey::default();
        for photo in photos {
            let path = folder.join(&photo.name);
            survey.add(&photo.name, read_profile(&path, &read_photo_header(&path)?)?);
        }
        Ok(survey.conclude(colour))
    }
}

/// What the photos looked at so far carry.
#[derive(Debug, Default)]
struct Survey {
    /// The first photo and its profile.
    first: Option<(String, Option<Vec<u8>>)>,
    /// The first photo whose profile is another one.
    other: Option<(String, Option<usize>)>,
    /// The first photo whose profile cannot be used, and why; and how many there are.
    ignored: Option<(String, String)>,
    ignored_count: usize,
}

impl Survey {
    fn add(&mut self, name: &str, profile: Profile) {
        let profile = match profile {
            Profile::Missing => None,
            Profile::Found(bytes) => Some(bytes),
            Profile::Ignored(why) => {
                self.ignored_count += 1;
                self.ignored.get_or_insert((name.to_string(), why));
                None
            }
        };
        match &self.first {
            None => self.first = Some((name.to_string(), profile)),
            Some((_, first)) if *first != profile && self.other.is_none() => {
                self.other = Some((name.to_string(), profile.map(|p| p.len())));
            }
            Some(_) => {}
        }
    }

    fn conclude(self, colour: Colour) -> CommonProfile {
        let mut warnings = Vec::new();
        if let Some((name, why)) = self.ignored {
            let more = match self.ignored_count - 1 {
                0 => String::new(),
                n => format!(" (and {n} more)"),
            };
            warnings.push(format!("the colour profile of {name}{more} is ignored: {why}"));
        }
        let Some((name, profile)) = self.first else {
            return CommonProfile { profile: None, warnings };
        };
        if let Some((other, bytes)) = self.other {
            let told = |bytes: Option<usize>| {
                bytes.map_or("none".to_string(), |n| format!("one of {n} bytes"))
            };
            let own = told(profile.map(|p| p.len()));
            warnings.push(format!(
                "the photos' colour profiles differ ({name}: {own}, {other}: {}), the mosaic carries none",
                told(bytes)
            ));
            return CommonProfile { profile: None, warnings };
        }
        let fits = |bytes: &Vec<u8>| profile_channels(bytes) == Some(colour.channels());
        if profile.as_ref().is_some_and(|p| !fits(p)) {
            let samples = if colour == Colour::Grey { "grey" } else { "RGB" };
            warnings.push(format!(
                "the photos' colour profile is not one for {samples} ({name}), the mosaic carries none"
            ));
        }
        CommonProfile { profile: profile.filter(fits), warnings }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(device: [u8; 4], mark: u8) -> Profile {
        let mut bytes = vec![mark; 200];
        bytes[16..20].copy_from_slice(&device);
        Profile::Found(bytes)
    }

    fn conclude(profiles: &[Profile], colour: Colour) -> CommonProfile {
        let mut survey = Survey::default();
        for (k, profile) in profiles.iter().enumerate() {
            survey.add(&format!("{k}.jpg"), profile.clone());
        }
        survey.conclude(colour)
    }

    #[test]
    fn a_profile_is_carried_if_all_agree() {
        let rgb = || profile(*b"RGB ", 1);
        let found = conclude(&[rgb(), rgb(), rgb()], Colour::Rgb);
        assert!(found.profile.is_some() && found.warnings.is_empty());
        let none = conclude(&[Profile::Missing, Profile::Missing], Colour::Rgb);
        assert_eq!(none, CommonProfile::default());
    }

    #[test]
    fn the_first_two_that_differ_are_named_once() {
        let (a, b) = (profile(*b"RGB ", 1), profile(*b"RGB ", 2));
        let found = conclude(&[a.clone(), a.clone(), b.clone(), Profile::Missing], Colour::Rgb);
        assert_eq!(found.profile, None);
        assert_eq!(
            found.warnings,
            [
                "the photos' colour profiles differ (0.jpg: one of 200 bytes, 2.jpg: one of 200 bytes), the mosaic carries none"
            ]
        );
        let found = conclude(&[Profile::Missing, a], Colour::Rgb);
        assert!(found.warnings[0].contains("(0.jpg: none, 1.jpg: one of 200 bytes)"));
    }

    #[test]
    fn a_profile_that_is_broken_or_for_other_channels_is_not_carried() {
        let found = conclude(&[profile(*b"GRAY", 1)], Colour::Rgb);
        assert_eq!(
            found.warnings,
            ["the photos' colour profile is not one for RGB (0.jpg), the mosaic carries none"]
        );
        assert_eq!(found.profile, None);
        let broken = || Profile::Ignored("it is cut".into());
        let found = conclude(&[broken(), broken()], Colour::Rgb);
        assert_eq!(
            found.warnings,
            ["the colour profile of 0.jpg (and 1 more) is ignored: it is cut"]
        );
    }
}
