//! The inner loops, eight values at a time.
//!
//! `FUSED` says whether the code is compiled for a processor that multiplies and adds in one instruction; instruction sets without
//! round differently in the last digits.

use multiversion::multiversion;
use multiversion::target::{match_target, target_cfg_f};

/// Neighbouring nodes of the value axis that are treated at once.
pub(super) const LANES: usize = 8;
/// What belongs to them.
pub(super) type Lanes = [f64; LANES];

/// Sums that stay in registers.
const ROWS: usize = 4;

#[inline(always)]
fn fma<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// What a filter takes from: lane `lane` of entry `entry`, by so many factors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tap {
    pub entry: usize,
    pub lane: usize,
    pub factors: Lanes,
}

/// out[x, r, y] = sum_k matrix[r, k] values[x, k, y], with shape [x, k, y].
pub(super) fn contract(values: &[Lanes], shape: [usize; 3], matrix: &[f64], out: &mut [Lanes]) {
    contract_up_to_avx512(values, shape, matrix, out);
}

/// out[b] = scales[b] norm sum over taps of factors values[entry, b][lane], `out` one entry.
pub(super) fn filter(values: &[Lanes], taps: &[Tap], norm: &Lanes, scales: &[f64], out: &mut [Lanes]) {
    filter_up_to_avx512(values, taps, norm, scales, out);
}

/// The sum of the squares of a - b.
pub(super) fn squares(a: &[Lanes], b: &[Lanes]) -> f64 {
    squares_up_to_avx512(a, b)
}

#[inline(always)]
fn contract_with<const FUSED: bool>(
    values: &[Lanes],
    [outer, n, inner]: [usize; 3],
    matrix: &[f64],
    out: &mut [Lanes],
) {
    let rank = matrix.len() / n;
    let mut line: Vec<Lanes> = vec![[0.0; LANES]; n];
    for x in 0..outer {
        let (values, out) = (&values[x * n * inner..][..n * inner], &mut out[x * rank * inner..][..rank * inner]);
        for y in 0..inner {
            let mut bits = [0; LANES];
            for (to, from) in line.iter_mut().zip(values[y..].iter().step_by(inner)) {
                *to = *from;
                (0..LANES).for_each(|lane| bits[lane] |= from[lane].to_bits());
            }
            // Most of a lattice is empty: highlights are narrow. The sign of a zero does not count.
            if bits.iter().fold(0, |all, bits| all | bits) << 1 == 0 {
                out[y..].iter_mut().step_by(inner).for_each(|out| *out = [0.0; LANES]);
                continue;
            }
            let mut first = 0;
            for rows in matrix.chunks(ROWS * n) {
                let out = &mut out[first * inner + y..];
                match rows.len() / n {
                    ROWS => products::<FUSED, ROWS>(rows, &line, out, inner),
                    3 => products::<FUSED, 3>(rows, &line, out, inner),
                    2 => products::<FUSED, 2>(rows, &line, out, inner),
                    _ => products::<FUSED, 1>(rows, &line, out, inner),
                }
                first += ROWS;
            }
        }
    }
}

#[inline(always)]
fn products<const FUSED: bool, const N: usize>(rows: &[f64], line: &[Lanes], out: &mut [Lanes], stride: usize) {
    let mut sums = [[0.0; LANES]; N];
    let n = line.len();
    let rows: [&[f64]; N] = std::array::from_fn(|row| &rows[row * n..][..n]);
    for (k, value) in line.iter().enumerate() {
        for (row, sum) in rows.iter().zip(&mut sums) {
            let factor = row[k];
            for lane in 0..LANES {
                sum[lane] = fma::<FUSED>(factor, value[lane], sum[lane]);
            }
        }
    }
    for (row, sum) in sums.into_iter().enumerate() {
        out[row * stride] = sum;
    }
}

#[inline(always)]
fn filter_with<const FUSED: bool>(values: &[Lanes], taps: &[Tap], norm: &Lanes, scales: &[f64], out: &mut [Lanes]) {
    let width = out.len();
    let mut first = 0;
    while first < width {
        let count = (width - first).min(ROWS);
        let mut sums = [[0.0; LANES]; ROWS];
        if count == ROWS {
            for tap in taps {
                let from = &values[tap.entry * width + first..][..ROWS];
                for (sum, from) in sums.iter_mut().zip(from) {
                    let from = from[tap.lane % LANES];
                    sum.iter_mut().zip(tap.factors).for_each(|(sum, factor)| *sum = fma::<FUSED>(from, factor, *sum));
                }
            }
        } else {
            for tap in taps {
                let from = &values[tap.entry * width + first..][..count];
                for (sum, from) in sums.iter_mut().zip(from) {
                    let from = from[tap.lane % LANES];
                    sum.iter_mut().zip(tap.factors).for_each(|(sum, factor)| *sum = fma::<FUSED>(from, factor, *sum));
                }
            }
        }
        for k in 0..count {
            for lane in 0..LANES {
                out[first + k][lane] = sums[k][lane] * norm[lane] * scales[first + k];
            }
        }
        first += ROWS;
    }
}

#[inline(always)]
fn squares_with<const FUSED: bool>(a: &[Lanes], b: &[Lanes]) -> f64 {
    let mut sums = [[0.0; LANES]; ROWS];
    let (a, b) = (a.as_chunks::<ROWS>(), b.as_chunks::<ROWS>());
    for (a, b) in a.0.iter().zip(b.0) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            for lane in 0..LANES {
                let d = a[lane] - b[lane];
                sum[lane] = fma::<FUSED>(d, d, sum[lane]);
            }
        }
    }
    for (a, b) in a.1.iter().zip(b.1) {
        for lane in 0..LANES {
            let d = a[lane] - b[lane];
            sums[0][lane] = fma::<FUSED>(d, d, sums[0][lane]);
        }
    }
    sums.as_flattened().iter().sum()
}

// One function an instruction set, each falling back on the next, so that tests reach every one of them.

#[multiversion(targets("x86_64+avx512f+avx512dq+fma"))]
fn contract_up_to_avx512(values: &[Lanes], shape: [usize; 3], matrix: &[f64], out: &mut [Lanes]) {
    match_target! {
        "x86_64+avx512f+avx512dq+fma" => contract_with::<true>(values, shape, matrix, out),
        _ => { contract_up_to_avx2(values, shape, matrix, out) },
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn contract_up_to_avx2(values: &[Lanes], shape: [usize; 3], matrix: &[f64], out: &mut [Lanes]) {
    const FUSED: bool = target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64"));
    contract_with::<FUSED>(values, shape, matrix, out);
}

#[multiversion(targets("x86_64+avx512f+avx512dq+fma"))]
fn filter_up_to_avx512(values: &[Lanes], taps: &[Tap], norm: &Lanes, scales: &[f64], out: &mut [Lanes]) {
    match_target! {
        "x86_64+avx512f+avx512dq+fma" => filter_with::<true>(values, taps, norm, scales, out),
        _ => { filter_up_to_avx2(values, taps, norm, scales, out) },
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn filter_up_to_avx2(values: &[Lanes], taps: &[Tap], norm: &Lanes, scales: &[f64], out: &mut [Lanes]) {
    const FUSED: bool = target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64"));
    filter_with::<FUSED>(values, taps, norm, scales, out);
}

#[multiversion(targets("x86_64+avx512f+avx512dq+fma"))]
fn squares_up_to_avx512(a: &[Lanes], b: &[Lanes]) -> f64 {
    match_target! {
        "x86_64+avx512f+avx512dq+fma" => squares_with::<true>(a, b),
        _ => { squares_up_to_avx2(a, b) },
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn squares_up_to_avx2(a: &[Lanes], b: &[Lanes]) -> f64 {
    const FUSED: bool = target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64"));
    squares_with::<FUSED>(a, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    type Functions = (
        fn(&[Lanes], [usize; 3], &[f64], &mut [Lanes]),
        fn(&[Lanes], &[Tap], &Lanes, &[f64], &mut [Lanes]),
        fn(&[Lanes], &[Lanes]) -> f64,
    );
    const DISPATCHED: [Functions; 2] = [
        (contract_up_to_avx512, filter_up_to_avx512, squares_up_to_avx512),
        (contract_up_to_avx2, filter_up_to_avx2, squares_up_to_avx2),
    ];
    const EITHER: [Functions; 2] = [
        (contract_with::<true>, filter_with::<true>, squares_with::<true>),
        (contract_with::<false>, filter_with::<false>, squares_with::<false>),
    ];

    fn waves(count: usize, frequency: f64) -> Vec<Lanes> {
        let wave = |k: usize, lane: usize| ((LANES * k + lane) as f64 * frequency).sin();
        (0..count).map(|k| std::array::from_fn(|lane| wave(k, lane))).collect()
    }

    /// A contraction of [2, 5, 3] to [2, 7, 3], a filter of all that, the squares of both.
    fn results((contract, filter, squares): Functions) -> Vec<f64> {
        let (values, matrix) = (waves(30, 0.7), waves(5, 0.3));
        let mut contracted = waves(42, 0.0);
        contract(&values, [2, 5, 3], &matrix.as_flattened()[..35], &mut contracted);
        let tap = |k: usize| Tap { entry: k / LANES, lane: k % LANES, factors: waves(k + 1, 0.9)[k] };
        let taps: Vec<Tap> = (0..16).map(tap).collect();
        let mut filtered = waves(21, 0.0);
        filter(&contracted, &taps, &[0.5; LANES], waves(3, 0.1).as_flattened(), &mut filtered);
        let mut all = contracted.as_flattened().to_vec();
        all.extend_from_slice(filtered.as_flattened());
        all.push(squares(&filtered, &values[..21]));
        all
    }

    #[test]
    fn every_instruction_set_gives_the_bits_of_its_multiplication() {
        let bits = |results: &[f64]| results.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let either = EITHER.map(results);
        let dispatched = DISPATCHED.map(results);
        assert_eq!(bits(&dispatched[0]), bits(&dispatched[1]));
        assert!(either.iter().any(|either| bits(either) == bits(&dispatched[0])));
        assert_ne!(bits(&either[0]), bits(&either[1]), "the bits do not tell one multiplication from the other");
        assert!(either[0].iter().zip(&either[1]).all(|(a, b)| (a - b).abs() < 1e-13 * a.abs().max(1.0)));
    }

    #[test]
    fn sums_are_those_of_their_definition() {
        let all = results(EITHER[1]);
        let (values, matrix) = (waves(30, 0.7), waves(5, 0.3));
        let (x, r, y, lane) = (1, 4, 2, 3);
        let expected: f64 = (0..5).map(|k| matrix.as_flattened()[r * 5 + k] * values[(x * 5 + k) * 3 + y][lane]).sum();
        assert!((all[((x * 7 + r) * 3 + y) * LANES + lane] - expected).abs() < 1e-14);
        let filtered = &all[42 * LANES..];
        let of_tap = |k: usize| all[(k / LANES * 21 + 20) * LANES + k % LANES] * waves(k + 1, 0.9)[k][lane];
        let expected = 0.5 * waves(3, 0.1).as_flattened()[20] * (0..16).map(of_tap).sum::<f64>();
        assert!((filtered[20 * LANES + lane] - expected).abs() < 1e-14);
        let squares: f64 = (0..21 * LANES).map(|k| (filtered[k] - values.as_flattened()[k]).powi(2)).sum();
        assert!((filtered[21 * LANES] - squares).abs() < 1e-12);
    }
}
