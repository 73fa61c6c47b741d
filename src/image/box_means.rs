//! Means over squares of pixels.

use rayon::prelude::*;

/// Pixels of one task, at least.
const CHUNK: usize = 4096;

/// Mean of `v` (row-major, `width` wide) over the pixels within `radius` to each side, without those beyond the border.
pub fn box_means(v: &[f64], width: usize, radius: usize) -> Vec<f64> {
    let height = v.len() / width.max(1);
    let along = |v: &[f64], n: usize, stride: usize, at: usize, start: usize| {
        let range = at.saturating_sub(radius)..(at + radius + 1).min(n);
        let count = range.len() as f64;
        range.map(|k| v[start + k * stride]).sum::<f64>() / count
    };
    let all = || (0..v.len()).into_par_iter().with_min_len(CHUNK);
    let rows: Vec<f64> = all().map(|i| along(v, width, 1, i % width, i - i % width)).collect();
    all().map(|i| along(&rows, height, width, i / width, i % width)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_the_pixels_there_are() {
        let v: Vec<f64> = (0..12).map(f64::from).collect();
        // Rows 0 1 2 3, 4 5 6 7, 8 9 10 11.
        let m = box_means(&v, 4, 1);
        assert_eq!((m[0], m[5], m[7]), (2.5, 5.0, 6.5));
        assert_eq!(box_means(&v, 4, 0), v);
        assert!(box_means(&v, 4, 9).iter().all(|m| *m == 5.5));
    }
}
