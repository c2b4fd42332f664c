//! [`world_file`]: where the pixels lie, as six lines of text beside the picture.
//!
//! The lines are A, D, B, E, C, F of x = A·column + B·row + C, y = D·column + E·row + F, column and row counted from 0 at
//! the *centre* of the first pixel: C and F are that centre, half a pixel inside the corner that GeoTIFF states.

use super::Georeference;

/// The text of a world file. Numbers are plain decimals, the shortest that read back to the same bits.
pub fn world_file(georeference: &Georeference) -> String {
    let Georeference { origin_u, origin_v, pixel_size, .. } = *georeference;
    let (u, v) = (origin_u + 0.5 * pixel_size, origin_v - 0.5 * pixel_size);
    // Display of an f64 never has an exponent, and reads back to the same bits.
    [pixel_size, 0.0, 0.0, -pixel_size, u, v].map(|number| format!("{number}\n")).concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(origin_u: f64, origin_v: f64, pixel_size: f64) -> Vec<String> {
        let text = world_file(&Georeference { origin_u, origin_v, pixel_size, epsg: None });
        assert!(text.ends_with('\n') && text.lines().count() == 6, "{text}");
        text.lines().map(str::to_owned).collect()
    }

    #[test]
    fn the_last_two_lines_are_the_centre_of_the_first_pixel() {
        let found = lines(500_000.0, 4_200_000.0, 0.5);
        assert_eq!(found, ["0.5", "0", "0", "-0.5", "500000.25", "4199999.75"]);
    }

    #[test]
    fn numbers_are_plain_and_read_back_to_the_same_bits() {
        for (u, v, p) in [(0.1 + 0.2, -1e-7, 1e-7), (1e21 / 3.0, 4e6 / 7.0, 1.0 / 3.0)] {
            let found = lines(u, v, p);
            let plain = |line: &String| line.chars().all(|c| "0123456789.-".contains(c));
            assert!(found.iter().all(plain), "{found:?}");
            let due = [p, 0.0, 0.0, -p, u + 0.5 * p, v - 0.5 * p];
            for (line, due) in found.iter().zip(due) {
                assert_eq!(line.parse::<f64>().unwrap().to_bits(), due.to_bits(), "{line}");
            }
        }
    }
}
