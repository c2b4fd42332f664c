//! [`IccProfile`]: a colour profile on its way from the photos to the mosaic.

use std::fmt::Write as _;

/// The bytes of an ICC colour profile; in a manifest they stand as hexadecimal digits.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct IccProfile(Vec<u8>);

impl IccProfile {
    /// A profile.
    pub fn new(bytes: Vec<u8>) -> Self {
        Self(bytes)
    }

    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

impl From<IccProfile> for String {
    fn from(profile: IccProfile) -> Self {
        profile.0.iter().fold(Self::with_capacity(2 * profile.0.len()), |mut text, byte| {
            write!(text, "{byte:02x}").expect("a string takes all");
            text
        })
    }
}

impl TryFrom<String> for IccProfile {
    type Error = &'static str;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        let digit = |b: u8| char::from(b).to_digit(16).and_then(|d| u8::try_from(d).ok());
        let (pairs, []) = text.as_bytes().as_chunks::<2>() else {
            return Err("an odd number of hexadecimal digits");
        };
        let byte = |pair: &[u8; 2]| Some(digit(pair[0])? << 4 | digit(pair[1])?);
        let bytes = pairs.iter().map(byte).collect::<Option<_>>();
        bytes.map(Self).ok_or("something else than hexadecimal digits")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_reads_back_and_what_is_no_hexadecimal_is_refused() {
        let profile = IccProfile::new((0..=255).collect());
        let text = serde_json::to_string(&profile).unwrap();
        assert!(text.starts_with("\"000102"));
        assert_eq!(serde_json::from_str::<IccProfile>(&text).unwrap(), profile);
        for wrong in ["\"0\"", "\"0g\"", "\"é\"", "7"] {
            assert!(serde_json::from_str::<IccProfile>(wrong).is_err(), "{wrong}");
        }
    }
}
