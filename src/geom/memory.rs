//! [`held_bytes`].

/// Memory that a vector holds, bytes, used or not.
pub fn held_bytes<T>(vector: &Vec<T>) -> u64 {
    (vector.capacity() * size_of::<T>()) as u64
}
