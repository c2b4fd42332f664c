//! The eight number types of PLY and the two byte orders.

/// Byte order of a binary file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

/// A number type of PLY.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    /// The type with this name in a header; both of PLY's sets of names are known.
    pub(super) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of a value in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The value at the start of `bytes`, which must hold one; exact for every type.
    #[inline]
    pub(super) fn read(self, bytes: &[u8], order: Order) -> f64 {
        match self {
            Self::I8 => f64::from(bytes[0].cast_signed()),
            Self::U8 => f64::from(bytes[0]),
            Self::I16 => f64::from(u16_at(bytes, order).cast_signed()),
            Self::U16 => f64::from(u16_at(bytes, order)),
            Self::I32 => f64::from(u32_at(bytes, order).cast_signed()),
            Self::U32 => f64::from(u32_at(bytes, order)),
            Self::F32 => f64::from(f32::from_bits(u32_at(bytes, order))),
            Self::F64 => f64::from_bits(u64_at(bytes, order)),
        }
    }

    /// The value at the start of `bytes` as a count or an index; `None` if it is negative, or not a whole number,
    /// or 2⁵³ or more.
    #[inline]
    pub(super) fn read_index(self, bytes: &[u8], order: Order) -> Option<u64> {
        match self {
            Self::U8 => Some(u64::from(bytes[0])),
            Self::U16 => Some(u64::from(u16_at(bytes, order))),
            Self::U32 => Some(u64::from(u32_at(bytes, order))),
            _ => whole(self.read(bytes, order)),
        }
    }
}

/// A number as a count or an index; `None` if it is negative, or not whole, or 2⁵³ or more.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a whole number between 0 and 2⁵³ is kept exactly"
)]
pub(super) fn whole(value: f64) -> Option<u64> {
    let is_index = (0.0..9_007_199_254_740_992.0).contains(&value) && value.fract() == 0.0;
    is_index.then_some(value as u64)
}

#[inline]
fn u16_at(bytes: &[u8], order: Order) -> u16 {
    let bytes = [bytes[0], bytes[1]];
    match order {
        Order::Little => u16::from_le_bytes(bytes),
        Order::Big => u16::from_be_bytes(bytes),
    }
}

#[inline]
pub(super) fn u32_at(bytes: &[u8], order: Order) -> u32 {
    let bytes = bytes[..4].try_into().expect("four bytes");
    match order {
        Order::Little => u32::from_le_bytes(bytes),
        Order::Big => u32::from_be_bytes(bytes),
    }
}

#[inline]
fn u64_at(bytes: &[u8], order: Order) -> u64 {
    let bytes = bytes[..8].try_into().expect("eight bytes");
    match order {
        Order::Little => u64::from_le_bytes(bytes),
        Order::Big => u64::from_be_bytes(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_reads_its_own_bytes_in_both_orders() {
        let cases: [(Scalar, &[u8], f64); 8] = [
            (Scalar::I8, &(-3_i8).to_le_bytes(), -3.0),
            (Scalar::U8, &200_u8.to_le_bytes(), 200.0),
            (Scalar::I16, &(-300_i16).to_le_bytes(), -300.0),
            (Scalar::U16, &60_000_u16.to_le_bytes(), 60_000.0),
            (Scalar::I32, &(-70_000_i32).to_le_bytes(), -70_000.0),
            (Scalar::U32, &4_000_000_000_u32.to_le_bytes(), 4e9),
            (Scalar::F32, &0.25_f32.to_le_bytes(), 0.25),
            (Scalar::F64, &1e300_f64.to_le_bytes(), 1e300),
        ];
        for (scalar, little, value) in cases {
            let big: Vec<u8> = little.iter().rev().copied().collect();
            assert_eq!(little.len(), scalar.size());
            assert_eq!(scalar.read(little, Order::Little).to_bits(), value.to_bits());
            assert_eq!(scalar.read(&big, Order::Big).to_bits(), value.to_bits());
            assert_eq!(scalar.read_index(little, Order::Little), whole(value));
            assert_eq!(scalar.read_index(&big, Order::Big), whole(value));
        }
        assert_eq!(whole(-1.0), None);
        assert_eq!(whole(f64::NAN), None);
        assert_eq!(whole(1.5), None);
        assert_eq!(whole(4e9), Some(4_000_000_000));
    }
}
