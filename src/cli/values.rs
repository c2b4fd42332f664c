//! Parsers of the flags' values. Each error says what is expected; the caller adds the flag's name.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use super::sections;
use crate::frame::Plane;
use crate::input::{AngleUnit, CameraFormat, Shift, TableLens};
use crate::output::{Compression, Meaning, PrintResolution};

/// Least memory cap, bytes: 256 MiB.
pub(super) const LEAST_MEMORY_BYTES: u64 = 256 << 20;
/// Tiles of a mosaic are squares of a multiple of this side, as TIFF demands.
const TILE_STEP: u32 = 16;
/// Largest side of a tile: 4096² pixels of RGBA in 16 bits are 128 MiB, half of the least memory cap.
const LARGEST_TILE: u32 = 4096;

type Parsed<T> = std::result::Result<T, String>;

/// `N` numbers separated by commas; `inf` and `-inf` are numbers here.
fn numbers<const N: usize>(text: &str) -> Parsed<[f64; N]> {
    let expected = || format!("expected {N} numbers separated by commas");
    let parse = |part: &str| part.trim().parse::<f64>().ok().filter(|value| !value.is_nan());
    let values: Option<Vec<f64>> = text.split(',').map(parse).collect();
    let values = values.ok_or_else(expected)?;
    <[f64; N]>::try_from(values).map_err(|wrong| format!("{}, found {}", expected(), wrong.len()))
}

fn finite<const N: usize>(values: [f64; N]) -> Parsed<[f64; N]> {
    if values.iter().all(|value| value.is_finite()) {
        Ok(values)
    } else {
        Err("expected finite numbers".into())
    }
}

fn ordered(min: f64, max: f64, what: &str) -> Parsed<()> {
    if min < max { Ok(()) } else { Err(format!("expected {what}, found {min} and {max}")) }
}

/// `U0,V0,U1,V1`, metres.
pub(super) fn extent(text: &str) -> Parsed<[f64; 4]> {
    check_extent(numbers(text)?)
}

/// An extent is finite and not empty.
pub(super) fn check_extent(extent: [f64; 4]) -> Parsed<[f64; 4]> {
    let [u_min, v_min, u_max, v_max] = finite(extent)?;
    ordered(u_min, u_max, "U0 less than U1")?;
    ordered(v_min, v_max, "V0 less than V1")?;
    Ok(extent)
}

/// `MIN,MAX`, metres, either of them infinite.
pub(super) fn elevation(text: &str) -> Parsed<[f64; 2]> {
    check_elevation(numbers(text)?)
}

/// A slab is not empty.
pub(super) fn check_elevation(slab: [f64; 2]) -> Parsed<[f64; 2]> {
    ordered(slab[0], slab[1], "MIN less than MAX")?;
    Ok(slab)
}

/// `FROM,TO,STEP`, metres.
pub(super) fn sections(text: &str) -> Parsed<[f64; 3]> {
    sections::check(numbers(text)?)
}

/// `X,Y,Z`, metres, or the text file of an ODM project.
pub(super) fn shift(text: &str) -> Parsed<Shift> {
    match numbers(text) {
        Ok(metres) => check_shift(Shift::Stated(metres)),
        Err(_) if is_text_file(text) => path(text.into()).map(Shift::OfOdm),
        Err(fault) => Err(fault),
    }
}

fn is_text_file(text: &str) -> bool {
    Path::new(text).extension().is_some_and(|end| end.eq_ignore_ascii_case("txt"))
}

/// A shift is finite.
pub(super) fn check_shift(shift: Shift) -> Parsed<Shift> {
    if let Shift::Stated(metres) = shift {
        finite(metres)?;
    }
    Ok(shift)
}

/// `X,Y,Z`, not zero.
pub(super) fn direction(text: &str) -> Parsed<[f64; 3]> {
    check_direction(numbers(text)?)
}

/// A direction is finite and not zero.
pub(super) fn check_direction(direction: [f64; 3]) -> Parsed<[f64; 3]> {
    let direction = finite(direction)?;
    if direction.iter().all(|x| *x == 0.0) {
        return Err("expected a direction, found 0,0,0".into());
    }
    Ok(direction)
}

/// `C,R`, columns and rows.
pub(super) fn pixel(text: &str) -> Parsed<[f64; 2]> {
    finite(numbers::<2>(text)?)
}

/// `X,Y,Z`, a ground point.
pub(super) fn point(text: &str) -> Parsed<[f64; 3]> {
    finite(numbers::<3>(text)?)
}

/// A length of any sign, metres.
pub(super) fn metres(text: &str) -> Parsed<f64> {
    Ok(finite(numbers::<1>(text)?)?[0])
}

/// `X,Y,Z;X,Y,Z;X,Y,Z`.
pub(super) fn plane_points(text: &str) -> Parsed<[[f64; 3]; 3]> {
    let points: Vec<_> = text.split(';').map(numbers::<3>).collect::<Parsed<_>>()?;
    match points[..] {
        [a, b, c] => check_plane_points([a, b, c]),
        _ => Err("expected three points X,Y,Z separated by semicolons".into()),
    }
}

/// Three points that span a plane.
pub(super) fn check_plane_points(points: [[f64; 3]; 3]) -> Parsed<[[f64; 3]; 3]> {
    Plane::through(points).map_err(|e| format!("expected {}, found {}", e.expected, e.found))?;
    Ok(points)
}

/// A length greater than zero, metres.
pub(super) fn positive(text: &str) -> Parsed<f64> {
    check_positive(finite(numbers::<1>(text)?)?[0])
}

/// A pixel has a size.
pub(super) fn check_positive(value: f64) -> Parsed<f64> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err("expected a number greater than 0".into())
    }
}

/// A length greater than zero, metres, perhaps infinite.
pub(super) fn longest(text: &str) -> Parsed<f64> {
    check_longest(numbers::<1>(text)?[0])
}

/// The longest edge is longer than nothing.
pub(super) fn check_longest(value: f64) -> Parsed<f64> {
    if value > 0.0 { Ok(value) } else { Err("expected a number greater than 0, or inf".into()) }
}

/// `1:N`, the scale of a print; N, which need not be whole.
pub(super) fn scale(text: &str) -> Parsed<f64> {
    let denominator = text.trim().strip_prefix("1:").and_then(|n| positive(n).ok());
    denominator.ok_or_else(|| format!("expected 1:N, N greater than 0, found {text:?}"))
}

/// Dots per inch.
pub(super) fn dpi(text: &str) -> Parsed<PrintResolution> {
    check_dpi(numbers::<1>(text)?[0])
}

/// Dots per inch that a print can have.
pub(super) fn check_dpi(dpi: f64) -> Parsed<PrintResolution> {
    PrintResolution::new(dpi).ok_or_else(|| format!("expected 1 to 100000, found {dpi}"))
}

/// A number that is not negative.
pub(super) fn not_negative(text: &str) -> Parsed<f64> {
    check_not_negative(numbers::<1>(text)?[0])
}

/// A tolerance or a factor is not negative.
pub(super) fn check_not_negative(value: f64) -> Parsed<f64> {
    if value >= 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err("expected a number of at least 0".into())
    }
}

/// `R,G,B` in the output's range, at most 65535.
pub(super) fn colour(text: &str) -> Parsed<[u16; 3]> {
    let parts: Option<Vec<u16>> =
        text.split(',').map(|part| part.trim().parse::<u16>().ok()).collect();
    let three = parts.and_then(|parts| <[u16; 3]>::try_from(parts).ok());
    three.ok_or_else(|| "expected three whole numbers R,G,B from 0 to 255 (16 bit: 65535)".into())
}

/// The word of a format of cameras.
pub(super) fn camera_format(text: &str) -> Parsed<CameraFormat> {
    let words = CameraFormat::words().join(", ");
    CameraFormat::from_word(text).ok_or_else(|| format!("expected one of {words}, found {text:?}"))
}

/// The word of a unit of angles.
pub(super) fn angle_unit(text: &str) -> Parsed<AngleUnit> {
    AngleUnit::from_word(text)
        .ok_or_else(|| format!("expected one of deg, gon, rad, found {text:?}"))
}

/// The word of a table's lens.
pub(super) fn table_lens(text: &str) -> Parsed<TableLens> {
    TableLens::from_word(text)
        .ok_or_else(|| format!("expected one of opencv, classical, corrections, found {text:?}"))
}

/// `EPSG:n`, kept as a text of that form.
pub(super) fn crs(text: &str) -> Parsed<String> {
    let code = text.trim().strip_prefix("EPSG:").and_then(|code| code.parse::<u32>().ok());
    code.map(|code| format!("EPSG:{code}")).ok_or_else(|| "expected EPSG:<number>".into())
}

/// Side of a tile, pixels.
pub(super) fn tile_size(text: &str) -> Parsed<u32> {
    check_tile_size(text.trim().parse().unwrap_or(0))
}

/// A tile's side is a multiple of 16.
pub(super) fn check_tile_size(side: u32) -> Parsed<u32> {
    if side > 0 && side.is_multiple_of(TILE_STEP) && side <= LARGEST_TILE {
        Ok(side)
    } else {
        Err(format!("expected a multiple of {TILE_STEP} up to {LARGEST_TILE}"))
    }
}

/// A number of threads.
pub(super) fn threads(text: &str) -> Parsed<usize> {
    check_threads(text.trim().parse().unwrap_or(0))
}

/// At least one thread, and no more than any machine has.
pub(super) fn check_threads(threads: usize) -> Parsed<usize> {
    if (1..=4096).contains(&threads) { Ok(threads) } else { Err("expected 1 to 4096".into()) }
}

/// A memory cap in bytes: `536870912`, `512MiB`, `2GiB`, `300MB`, `1G` (binary, as memory is counted).
pub(super) fn memory(text: &str) -> Parsed<u64> {
    let text = text.trim();
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let unit: u64 = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1,
        "k" | "kib" => 1 << 10,
        "m" | "mib" => 1 << 20,
        "g" | "gib" => 1 << 30,
        "t" | "tib" => 1 << 40,
        "kb" => 1_000,
        "mb" => 1_000_000,
        "gb" => 1_000_000_000,
        "tb" => 1_000_000_000_000,
        _ => return Err("expected bytes, or a size like 512MiB, 2GiB, 300MB or 1G".into()),
    };
    let bytes = match number.parse::<u64>() {
        Ok(whole) => whole.checked_mul(unit),
        Err(_) => number.parse::<f64>().ok().and_then(|share| fraction_of(unit, share)),
    };
    check_memory(bytes.ok_or("expected bytes, or a size like 512MiB, 2GiB, 300MB or 1G")?)
}

/// `share · unit`, rounded down; `None` beyond what a `f64` holds exactly.
fn fraction_of(unit: u64, share: f64) -> Option<u64> {
    let bytes = (share * unit as f64).floor();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "range checked")]
    (0.0..9.0e15).contains(&bytes).then_some(bytes as u64)
}

/// A memory cap is at least 256 MiB.
pub(super) fn check_memory(bytes: u64) -> Parsed<u64> {
    if bytes >= LEAST_MEMORY_BYTES {
        Ok(bytes)
    } else {
        Err(format!("expected at least 256 MiB, found {bytes} bytes"))
    }
}

/// A layer by its name, the mosaic not counted.
pub(super) fn layer(text: &str) -> Parsed<Meaning> {
    let found = layers().find(|layer| layer.name() == text.trim());
    let names: Vec<_> = layers().map(Meaning::name).collect();
    found.ok_or_else(|| format!("expected some of {}", names.join(", ")))
}

/// The layers that can be asked for.
fn layers() -> impl Iterator<Item = Meaning> {
    Meaning::ALL.into_iter().filter(|meaning| *meaning != Meaning::Mosaic)
}

/// A compression by its name.
pub(super) fn compression(text: &str) -> Parsed<Compression> {
    let all = [Compression::Deflate, Compression::Zstd, Compression::Lzw, Compression::None];
    let names = all.map(Compression::name).join(", ");
    let found = all.into_iter().find(|compression| compression.name() == text.trim());
    found.ok_or_else(|| format!("expected one of {names}"))
}

/// A path or a pattern; another flag in its place means that the value was forgotten.
pub(super) fn not_a_flag(text: OsString) -> Parsed<OsString> {
    match text.to_str() {
        Some("") => Err("expected a value, found an empty text".into()),
        Some(flag) if flag.starts_with("--") => {
            Err(format!("expected a value, found the flag {flag} (write ./{flag} for a file)"))
        }
        _ => Ok(text),
    }
}

/// A path.
pub(super) fn path(text: OsString) -> Parsed<PathBuf> {
    not_a_flag(text).map(PathBuf::from)
}

/// A pattern for photo names.
pub(super) fn pattern(text: OsString) -> Parsed<String> {
    let text = not_a_flag(text)?;
    text.into_string().map_err(|text| format!("expected UTF-8, found {}", text.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_in_binary_and_decimal_units() {
        for (text, bytes) in [
            ("512MiB", 512 << 20),
            ("2GiB", 2 << 30),
            ("300MB", 300_000_000),
            ("1G", 1 << 30),
            ("1.5 gib", 3 << 29),
            ("536870912", 536_870_912),
        ] {
            assert_eq!(memory(text), Ok(bytes), "{text}");
        }
    }

    #[test]
    fn senseless_sizes_are_refused() {
        for text in
            ["", "MiB", "-1G", "1GX", "1.2.3G", "99999999999999999999G", "9e99", "17179869184G"]
        {
            assert!(memory(text).is_err(), "{text}");
        }
        assert_eq!(
            memory("255MiB"),
            Err("expected at least 256 MiB, found 267386880 bytes".into())
        );
        assert_eq!(memory("256MiB"), Ok(256 << 20));
    }

    #[test]
    fn a_slab_may_be_open_but_not_empty() {
        assert_eq!(elevation("-inf,2.5"), Ok([f64::NEG_INFINITY, 2.5]));
        assert_eq!(elevation("-1, inf"), Ok([-1.0, f64::INFINITY]));
        assert!(elevation("2,2").is_err() && elevation("3,2").is_err());
        assert!(elevation("nan,2").is_err() && elevation("1").is_err() && elevation("").is_err());
    }

    #[test]
    fn an_extent_is_four_finite_ordered_numbers() {
        assert_eq!(extent("-1.5,-2,3,4e2"), Ok([-1.5, -2.0, 3.0, 400.0]));
        for text in ["0,0,1", "0,0,1,1,2", "0,0,0,1", "0,1,1,1", "0,0,inf,1", "0,0,x,1"] {
            assert!(extent(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_colour_is_three_samples() {
        assert_eq!(colour("255, 0,65535"), Ok([255, 0, 65535]));
        for text in ["1,2", "1,2,3,4", "1,2,65536", "1,2,-3", "1,2,3.5"] {
            assert!(colour(text).is_err(), "{text}");
        }
    }

    #[test]
    fn tiles_threads_and_codes_have_limits() {
        assert_eq!((tile_size("16"), tile_size("4096")), (Ok(16), Ok(4096)));
        for text in ["0", "24", "-16", "4112", "x"] {
            assert!(tile_size(text).is_err(), "{text}");
        }
        assert!(threads("0").is_err() && threads("two").is_err() && threads("8") == Ok(8));
        assert_eq!(crs("EPSG:32634"), Ok("EPSG:32634".into()));
        assert!(crs("32634").is_err() && crs("EPSG:x").is_err());
    }

    #[test]
    fn a_layer_is_known_by_name_and_the_mosaic_is_none() {
        assert_eq!(layer("elevation"), Ok(Meaning::Elevation));
        let error = layer("mosaic").unwrap_err();
        assert_eq!(error, "expected some of elevation, face, count, used, coverage, best");
    }

    #[test]
    fn a_flag_is_no_value_but_a_minus_may_begin_one() {
        assert!(path("--out".into()).is_err() && path("".into()).is_err());
        assert_eq!(path("-x.ply".into()), Ok(PathBuf::from("-x.ply")));
    }

    #[test]
    fn lengths_are_positive_and_tolerances_not_negative() {
        assert_eq!(positive("0.002"), Ok(0.002));
        assert!(positive("0").is_err() && positive("-1").is_err() && positive("inf").is_err());
        assert_eq!(not_negative("0"), Ok(0.0));
        assert_eq!((scale("1:50"), scale(" 1:12.5")), (Ok(50.0), Ok(12.5)));
        for text in ["50", "1:0", "1:-5", "2:50", "1:", "1:inf", "1/50"] {
            assert!(scale(text).is_err(), "{text}");
        }
        assert_eq!(dpi("300").unwrap().dpi().to_bits(), 300_f64.to_bits());
        assert!(dpi("0").is_err() && dpi("nan").is_err() && dpi("100001").is_err());
        assert!(not_negative("-0.1").is_err() && not_negative("nan").is_err());
        assert_eq!(shift("-5e5, 0,4200000.25"), Ok(Shift::Stated([-5e5, 0.0, 4_200_000.25])));
        assert_eq!(shift("odm/coords.txt"), Ok(Shift::OfOdm("odm/coords.txt".into())));
        assert!(shift("0,0").is_err() && shift("inf,0,0").is_err() && shift("0,nan,0").is_err());
        assert!(direction("0,0,0").is_err() && direction("0,0,-1").is_ok());
    }
}
