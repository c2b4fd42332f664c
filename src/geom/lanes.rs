//! Kernels compiled for the widest vectors that the CPU has.
//!
//! In: a [`Kernel`], a loop over arrays that the compiler can turn into vector instructions. Out: what it returns.
//! Promises: the same bits on every CPU. Vectors of any width do the same IEEE 754 operations on each element; the
//! compiler neither fuses a product with a sum nor reorders a sum. So the scalar code *is* the definition, and its
//! own twin: [`run_baseline`] runs it as it is, [`run_widest`] the same source with wider registers.

#![expect(
    unsafe_code,
    reason = "calls functions compiled for AVX2 and AVX-512 after asking the CPU for them"
)]

/// Lanes that kernels lay their loops out for: f32 in one AVX2 register.
pub const LANES: usize = 8;

/// A loop worth wide vectors. `run` and all that it calls in the loop must be inlined (`#[inline(always)]` where the
/// compiler might not), or it stays as narrow as the rest of the program.
pub trait Kernel {
    /// What it comes to.
    type Output;

    /// The loop.
    fn run(self) -> Self::Output;
}

/// Runs a kernel with the widest vectors that this CPU has: AVX-512 or AVX2 on x86-64, else those that every
/// CPU of the target has.
#[inline]
pub fn run_widest<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if has_avx512() {
        // SAFETY: the CPU has all that the function asks for.
        return unsafe { run_avx512(kernel) };
    }
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the CPU has AVX2, which is all that the function asks for.
        return unsafe { run_avx2(kernel) };
    }
    run_baseline(kernel)
}

/// Runs a kernel with the vectors that every CPU of the target has.
#[inline]
pub fn run_baseline<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

/// The kernel's loop, inlined here and so compiled for AVX2. Not with FMA: no product is ever fused with a sum.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

/// Whether the CPU has what [`run_avx512`] is compiled for.
#[cfg(target_arch = "x86_64")]
#[inline]
fn has_avx512() -> bool {
    std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512bw")
        && std::arch::is_x86_feature_detected!("avx512dq")
        && std::arch::is_x86_feature_detected!("avx512vl")
}

/// The kernel's loop, inlined here and so compiled for AVX-512. Though that brings FMA, no product is ever fused with a
/// sum: the compiler does so only where the source says it.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Horner<'a> {
        at: &'a [f64],
        out: &'a mut [f64],
    }

    impl Kernel for Horner<'_> {
        type Output = ();

        #[inline(always)]
        #[expect(clippy::inline_always, reason = "as a kernel must")]
        fn run(self) {
            for (o, &x) in self.out.iter_mut().zip(self.at) {
                *o = (1.0 + x * (0.3 + x * (0.1 + x * -0.7))) / (1.0 + x * x).sqrt();
            }
        }
    }

    #[test]
    fn wide_and_narrow_vectors_give_the_same_bits() {
        let at: Vec<f64> = (0..1003).map(|k| f64::from(k) * 0.013_7 - 5.0).collect();
        let (mut narrow, mut wide) = (vec![0.0; at.len()], vec![0.0; at.len()]);
        run_baseline(Horner { at: &at, out: &mut narrow });
        let mut check = |name: &str, run: &dyn Fn(Horner<'_>)| {
            wide.fill(0.0);
            run(Horner { at: &at, out: &mut wide });
            assert!(narrow.iter().zip(&wide).all(|(a, b)| a.to_bits() == b.to_bits()), "{name}");
        };
        check("widest", &|kernel| run_widest(kernel));
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the CPU has AVX2.
            check("AVX2", &|kernel| unsafe { run_avx2(kernel) });
        }
        assert!(narrow.iter().any(|v| v.to_bits() != narrow[0].to_bits()));
    }
}
