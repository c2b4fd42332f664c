//! What became of each photo, so that a badly oriented one stands out.

use serde::Serialize;

/// Counts of one photo over the whole mosaic. Integers, so that the order in which tiles add them up is nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PhotoTally {
    /// Pixels that the photo sees.
    pub seen: u64,
    /// Pixels whose colour it is a part of.
    pub used: u64,
    /// Pixels where it was dropped as an outlier.
    pub rejected: u64,
    /// Pixels where it could be compared: those that at least one more photo sees.
    pub compared: u64,
    /// Sum over the pixels compared of the distance of its sample to the blended colour, in 1/256 of an output unit,
    /// each rounded to an integer.
    pub residual_256: u64,
}

impl PhotoTally {
    /// Adds the counts of another part of the mosaic.
    pub fn add(&mut self, other: &Self) {
        self.seen += other.seen;
        self.used += other.used;
        self.rejected += other.rejected;
        self.compared += other.compared;
        self.residual_256 += other.residual_256;
    }
}

/// What became of one photo.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhotoReport {
    /// Index in the whole camera set, ordered by bytewise name, as in the layer `best`.
    pub id: u32,
    /// Name in the camera set.
    pub name: String,
    /// Pixels that it sees.
    pub pixels_seen: u64,
    /// Pixels whose colour it is a part of.
    pub pixels_used: u64,
    /// Pixels where it was dropped as an outlier.
    pub pixels_rejected: u64,
    /// Mean distance of its samples to the blended colour over the pixels that another photo sees too, in output units (0 … 255 or
    /// 0 … 65535, Euclidean over the channels); `None` if there is none.
    pub mean_residual: Option<f64>,
    /// The same as a share of the output's range.
    pub mean_residual_share: Option<f64>,
    /// How it was levelled; left out if it was not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub levelling: Option<PhotoLevelling>,
}

/// How a photo was brought to the tone of the others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhotoLevelling {
    /// What its red, green and blue are multiplied by, vignetting and field not counted.
    pub gain: [f64; 3],
    /// Logarithm of its camera's vignetting by ρ² and ρ⁴, ρ = 1 at the frame's corners.
    pub vignetting: [f64; 2],
    /// Surface points at which it was compared with others.
    pub points: u64,
    /// Median difference to the mean of all photos there, natural logarithm, as photographed.
    pub residual_before: f64,
    /// The same, levelled.
    pub residual_after: f64,
    /// Id of the lowest photo of those with which it was levelled.
    pub group: u32,
}

impl PhotoReport {
    /// The report of photo `id` from its counts; `range` is the output's greatest value, 255 or 65535.
    pub fn new(id: u32, name: impl Into<String>, tally: &PhotoTally, range: f64) -> Self {
        let mean =
            (tally.compared > 0).then(|| tally.residual_256 as f64 / 256.0 / tally.compared as f64);
        Self {
            id,
            name: name.into(),
            pixels_seen: tally.seen,
            pixels_used: tally.used,
            pixels_rejected: tally.rejected,
            mean_residual: mean,
            mean_residual_share: mean.map(|residual| residual / range),
            levelling: None,
        }
    }
}

/// A photo is suspicious if its mean residual is this many times the photos' median.
const SUSPICIOUS_FACTOR: f64 = 2.0;
/// A median of fewer photos says nothing about one of them.
const FEWEST_FOR_A_MEDIAN: usize = 3;
/// Residuals below this share of the range are the noise of a camera, however small the median.
const NOISE_SHARE: f64 = 1.0 / 255.0;

/// The photos whose mean residual is at least twice the median of all photos that see something, worst first,
/// with that median in output units. Their orientation is likely wrong, or something stood before the object.
pub fn suspicious(photos: &[PhotoReport]) -> (Vec<&PhotoReport>, Option<f64>) {
    let mut residuals: Vec<f64> = photos.iter().filter_map(|photo| photo.mean_residual).collect();
    if residuals.len() < FEWEST_FOR_A_MEDIAN {
        return (Vec::new(), None);
    }
    residuals.sort_by(f64::total_cmp);
    let upper = residuals.len() / 2;
    let lower = (residuals.len() - 1) / 2;
    let median = f64::midpoint(residuals[lower], residuals[upper]);
    let stands_out = |photo: &&PhotoReport| {
        photo.mean_residual.is_some_and(|residual| residual >= SUSPICIOUS_FACTOR * median)
            && photo.mean_residual_share.is_some_and(|share| share >= NOISE_SHARE)
    };
    let mut found: Vec<_> = photos.iter().filter(stands_out).collect();
    found.sort_by(|a, b| {
        b.mean_residual.partial_cmp(&a.mean_residual).unwrap_or_else(|| a.id.cmp(&b.id))
    });
    (found, Some(median))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn photo(id: u32, residual: u64) -> PhotoReport {
        let tally = PhotoTally {
            seen: 10,
            compared: 10,
            used: 9,
            rejected: 1,
            residual_256: residual * 2560,
        };
        PhotoReport::new(id, format!("{id}.jpg"), &tally, 255.0)
    }

    #[test]
    fn tallies_add_up_in_any_order() {
        let a = PhotoTally { seen: 3, compared: 3, used: 2, rejected: 1, residual_256: 700 };
        let b = PhotoTally { seen: 5, compared: 5, used: 5, rejected: 0, residual_256: 11 };
        let (mut ab, mut ba) = (a, b);
        ab.add(&b);
        ba.add(&a);
        assert_eq!(ab, ba);
        assert_eq!(
            ab,
            PhotoTally { seen: 8, compared: 8, used: 7, rejected: 1, residual_256: 711 }
        );
    }

    #[test]
    fn the_mean_residual_is_in_output_units_and_as_a_share_of_the_range() {
        let found = photo(4, 51);
        assert_eq!((found.mean_residual, found.mean_residual_share), (Some(51.0), Some(0.2)));
        let blind = PhotoReport::new(0, "a", &PhotoTally::default(), 255.0);
        assert_eq!((blind.mean_residual, blind.mean_residual_share), (None, None));
    }

    #[test]
    fn the_photo_that_disagrees_with_all_others_stands_out() {
        let photos: Vec<_> =
            [4, 5, 40, 5, 12, 4].iter().zip(0..).map(|(r, i)| photo(i, *r)).collect();
        let (found, median) = suspicious(&photos);
        assert_eq!(found.iter().map(|p| p.id).collect::<Vec<_>>(), [2, 4]);
        assert_eq!(median, Some(5.0));
    }

    #[test]
    fn two_photos_or_mere_noise_accuse_nobody() {
        assert_eq!(suspicious(&[photo(0, 1), photo(1, 99)]), (Vec::new(), None));
        let quiet: Vec<_> = (0..5).map(|i| photo(i, 0)).collect();
        assert!(suspicious(&quiet).0.is_empty());
    }
}
