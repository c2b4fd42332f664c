//! [`Texture`]: an analytic colour for every point of a scene.

use glam::DVec3;

use super::random::{Random, hash_unit};

/// What a face is part of; each part has its own stone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Part {
    /// The base on which all stands.
    Plinth,
    /// The recessed wall.
    Wall,
    /// Jambs, sills and soffits of openings.
    Reveal,
    /// The back of a niche or a window.
    Niche,
    /// The wall that the columns carry, with its arches and piers.
    Arcade,
    /// Column shafts.
    Shaft,
    /// Bases and capitals.
    Capital,
    /// The cornice and its dentils.
    Cornice,
}

impl Part {
    /// All parts.
    pub const ALL: [Self; 8] = [
        Self::Plinth,
        Self::Wall,
        Self::Reveal,
        Self::Niche,
        Self::Arcade,
        Self::Shaft,
        Self::Capital,
        Self::Cornice,
    ];

    /// Mean colour, 0 to 1.
    fn base(self) -> [f64; 3] {
        match self {
            Self::Plinth => [0.47, 0.45, 0.43],
            Self::Wall => [0.66, 0.50, 0.38],
            Self::Reveal => [0.54, 0.52, 0.42],
            Self::Niche => [0.36, 0.44, 0.53],
            Self::Arcade => [0.69, 0.63, 0.52],
            Self::Shaft => [0.60, 0.57, 0.56],
            Self::Capital => [0.72, 0.66, 0.48],
            Self::Cornice => [0.63, 0.56, 0.48],
        }
    }

    /// Height of a course and length of a stone, metres; no joints where it is `None`.
    fn ashlar(self) -> Option<[f64; 2]> {
        match self {
            Self::Plinth => Some([0.27, 0.83]),
            Self::Wall => Some([0.31, 0.62]),
            Self::Arcade => Some([0.36, 0.71]),
            Self::Shaft => Some([0.68, 40.0]),
            Self::Niche => Some([0.43, 0.37]),
            Self::Cornice => Some([5.0, 0.93]),
            Self::Reveal | Self::Capital => None,
        }
    }
}

/// An analytic, solid texture: a colour for every point of scene space and every part.
///
/// A sum of waves in many directions and wavelengths, none shorter than `finest_m`, and ashlar: stones of
/// different tone with darker joints, softened so that they hold next to nothing (amplitude 4 %) shorter than
/// `finest_m`. A photo whose pixel covers at most a quarter of `finest_m` therefore resolves all of it, and
/// what resampling adds is small and known. No symmetry: a flip, a turn or a shift of less than a stone changes
/// every place. A pure function of point and part; the same on every machine.
#[derive(Debug, Clone)]
pub struct Texture {
    finest_m: f64,
    waves: Vec<Wave>,
}

/// One wave of the pattern: `amplitude · sin(vector · p + phase + part's own phase)`.
#[derive(Debug, Clone, Copy)]
struct Wave {
    vector: DVec3,
    phase: f64,
    amplitude: [f64; 3],
}

/// Wavelengths in units of the finest, and luminance amplitudes. The ratios have no common multiple.
const WAVES: [(f64, f64); 8] = [
    (1.0, 0.022),
    (1.37, 0.022),
    (1.93, 0.024),
    (3.7, 0.026),
    (7.9, 0.028),
    (19.0, 0.030),
    (61.0, 0.032),
    (170.0, 0.034),
];

impl Texture {
    /// The texture whose shortest wavelength is `finest_m` metres.
    pub fn new(finest_m: f64) -> Self {
        let mut random = Random::new(0x6772_6f75_6e64);
        let waves = WAVES.iter().zip(0_u32..).map(|(&(ratio, amplitude), k)| {
            // Directions spread by the golden section, near the façade's plane, so that no wave is seen end-on
            // from the front.
            let angle = 0.3 + std::f64::consts::PI * 0.618 * f64::from(k);
            let tilt = random.between(-0.5, 0.5);
            let in_plane = DVec3::new(libm::cos(angle), libm::sin(angle), 0.0);
            let direction = in_plane * libm::cos(tilt) + DVec3::Z * libm::sin(tilt);
            let hue = random.between(-0.5, 0.5);
            Wave {
                vector: direction * (std::f64::consts::TAU / (ratio * finest_m)),
                phase: random.between(0.0, std::f64::consts::TAU),
                amplitude: [amplitude * (1.0 + hue), amplitude, amplitude * (1.0 - hue)],
            }
        });
        Self { finest_m, waves: waves.collect() }
    }

    /// Shortest wavelength, metres.
    pub fn finest_m(&self) -> f64 {
        self.finest_m
    }

    /// Colour (red, green, blue) of the point `p` in scene coordinates on a face of `part`; within 0.02 and 0.98.
    pub fn colour(&self, p: DVec3, part: Part) -> [f64; 3] {
        let own_phase = hash_unit(part as u64) * std::f64::consts::TAU;
        let mut rgb = part.base();
        for wave in &self.waves {
            let s = libm::sin(wave.vector.dot(p) + wave.phase + own_phase);
            for (c, a) in rgb.iter_mut().zip(wave.amplitude) {
                *c += a * s;
            }
        }
        if let Some(stone) = part.ashlar() {
            let tone = self.ashlar(p, stone, part);
            rgb = rgb.map(|c| c * tone);
        }
        rgb.map(|c| c.clamp(0.02, 0.98))
    }

    /// The factor by which stones and joints change the colour, about 0.55 to 1.1.
    fn ashlar(&self, p: DVec3, [height, length]: [f64; 2], part: Part) -> f64 {
        // The third coordinate enters so that walls across the façade have joints too; the offset keeps
        // floors and sills, whose y is a round number, off the horizontal joints.
        let (along, up) = (p.x + 0.6 * p.z, p.y + 0.173);
        let row = (up / height).floor();
        let within = up - row * height;
        // Joint above or below, whichever is nearer; two courses are blended across it.
        let to_next = height - within;
        let (other, distance) =
            if within < to_next { (row - 1.0, within) } else { (row + 1.0, to_next) };
        let here = self.course(along, row, length, part);
        let tone = if distance < self.finest_m {
            let there = self.course(along, other, length, part);
            mix(there, here, rise(distance / self.finest_m))
        } else {
            here
        };
        tone * self.joint(distance)
    }

    /// The factor of the stones of one course and the joints between them.
    fn course(&self, along: f64, row: f64, length: f64, part: Part) -> f64 {
        // Each course is shifted by its own share of a stone's length.
        let x = along / length + 0.5 * row + 0.31 * hash_unit(key(row, 0.0, part));
        let stone = x.floor();
        let within = (x - stone) * length;
        let to_next = length - within;
        let (other, distance) =
            if within < to_next { (stone - 1.0, within) } else { (stone + 1.0, to_next) };
        let tone = |s: f64| 0.9 + 0.2 * hash_unit(key(row, s, part));
        let mut value = tone(stone);
        if distance < self.finest_m {
            value = mix(tone(other), value, rise(distance / self.finest_m));
        }
        value * self.joint(distance)
    }

    /// The darkening of a joint at `distance` metres from its middle; a Gaussian whose spectrum at the finest
    /// wavelength has fallen to 4 %.
    fn joint(&self, distance: f64) -> f64 {
        let t = distance / (0.4 * self.finest_m);
        if t > 5.0 { 1.0 } else { 1.0 - 0.38 * libm::exp(-0.5 * t * t) }
    }
}

/// `there` at −1, `here` at +1, their mean at 0: half of a smooth step, for `t` in 0 to 1.
fn rise(t: f64) -> f64 {
    let s = 0.5 + 0.5 * t;
    s * s * s * (s * (s * 6.0 - 15.0) + 10.0)
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// One key for a stone; rows and stones are whole numbers.
fn key(row: f64, stone: f64, part: Part) -> u64 {
    (row * 8192.0 + stone).to_bits().wrapping_add((part as u64) << 56)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FINEST: f64 = 0.02;

    fn walk() -> impl Iterator<Item = (DVec3, Part)> {
        let mut r = Random::new(3);
        (0..20_000).map(move |k| {
            let p = DVec3::new(r.between(0.0, 7.4), r.between(0.0, 5.5), r.between(-1.4, 0.3));
            (p, Part::ALL[k % 8])
        })
    }

    #[test]
    fn the_texture_never_clips() {
        let t = Texture::new(FINEST);
        for (p, part) in walk() {
            assert!(t.colour(p, part).iter().all(|c| (0.05..0.97).contains(c)), "{p} {part:?}");
        }
    }

    #[test]
    fn the_texture_is_continuous_across_stones_and_courses() {
        let t = Texture::new(FINEST);
        for (p, part) in walk() {
            let q = p + DVec3::new(1e-6, 1e-6, 0.0);
            let (a, b) = (t.colour(p, part), t.colour(q, part));
            // A full swing over a quarter of the finest wavelength would change by 2e-4 over a micrometre.
            assert!((0..3).all(|c| (a[c] - b[c]).abs() < 2e-4), "{p} {part:?} {a:?} {b:?}");
        }
    }

    #[test]
    fn a_pixel_of_a_quarter_of_the_finest_wavelength_resolves_the_texture() {
        // Linear interpolation over that pixel must come near: what is finer could not be guessed.
        let t = Texture::new(FINEST);
        let step = DVec3::X * (FINEST / 4.0);
        let mut sum = 0.0;
        for (p, part) in walk() {
            let [a, b, c] = [p, p + step, p + 2.0 * step].map(|q| t.colour(q, part)[1]);
            sum += (b - 0.5 * (a + c)).powi(2);
        }
        let rms = (sum / 20_000.0).sqrt();
        assert!(rms < 0.02, "{rms}");
    }

    #[test]
    fn parts_differ_and_a_flip_shows() {
        let t = Texture::new(FINEST);
        let mut flip = 0.0;
        for (p, part) in walk() {
            let q = DVec3::new(7.4 - p.x, p.y, p.z);
            flip += (t.colour(p, part)[0] - t.colour(q, part)[0]).abs();
        }
        assert!(flip / 20_000.0 > 0.05, "{flip}");
        let p = DVec3::new(3.0, 2.0, 0.0);
        for a in Part::ALL {
            for b in Part::ALL {
                let [x, y] = [a, b].map(|part| DVec3::from(t.colour(p, part)));
                assert!(a == b || x.distance(y) > 0.02, "{a:?} {b:?}");
            }
        }
    }
}
