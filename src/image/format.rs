//! What the samples of a photo or a mosaic are: [`Colour`] and [`Depth`].

/// Channels of colour, alpha not counted.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
pub enum Colour {
    /// One channel.
    Grey,
    /// Three channels.
    Rgb,
}

/// Bits of a sample.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
pub enum Depth {
    /// 0 to 255.
    Eight,
    /// 0 to 65535.
    Sixteen,
}

impl Colour {
    /// 1 or 3.
    pub fn channels(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::Rgb => 3,
        }
    }
}

impl Depth {
    /// 8 or 16.
    pub fn bits(self) -> u32 {
        match self {
            Self::Eight => 8,
            Self::Sixteen => 16,
        }
    }

    /// The greatest sample: 255 or 65535.
    pub fn max(self) -> u16 {
        match self {
            Self::Eight => 255,
            Self::Sixteen => 65535,
        }
    }

    /// What a sample of this depth is multiplied by in an image of depth `to`: 1, 257 or 1/257.
    pub fn gain(self, to: Self) -> f32 {
        f32::from(to.max()) / f32::from(self.max())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "whole numbers")]
    fn an_8_bit_white_is_a_16_bit_white() {
        assert_eq!(Depth::Eight.gain(Depth::Sixteen), 257.0);
        assert_eq!(Depth::Sixteen.gain(Depth::Sixteen), 1.0);
        assert_eq!(255.0 * Depth::Eight.gain(Depth::Sixteen), f32::from(Depth::Sixteen.max()));
    }
}
