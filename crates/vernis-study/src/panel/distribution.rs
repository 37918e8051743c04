//! Tails and quantiles of Student's t and Fisher's F, from `statrs`: the one place that turns a statistic into a
//! probability. `None` where a statistic is not finite or a number of degrees of freedom is not positive.

use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

/// P(|T| >= |t|) of Student's t with `freedom` degrees of freedom.
pub fn t_two_sided(t: f64, freedom: f64) -> Option<f64> {
    let student = StudentsT::new(0.0, 1.0, freedom).ok()?;
    t.is_finite().then(|| (2.0 * student.sf(t.abs())).min(1.0))
}

/// The value that Student's t exceeds with probability 2.5 %.
pub fn t_975(freedom: f64) -> Option<f64> {
    let value = StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(0.975);
    value.is_finite().then_some(value)
}

/// P(F >= f) of Fisher's F with `d1` and `d2` degrees of freedom.
pub fn f_upper(f: f64, d1: f64, d2: f64) -> Option<f64> {
    let fisher = FisherSnedecor::new(d1, d2).ok()?;
    (f.is_finite() && f >= 0.0).then(|| fisher.sf(f))
}

/// The value that Fisher's F exceeds with probability 2.5 %.
pub fn f_975(d1: f64, d2: f64) -> Option<f64> {
    let value = FisherSnedecor::new(d1, d2).ok()?.inverse_cdf(0.975);
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: Option<f64>, expected: f64, tolerance: f64) {
        let found = found.unwrap();
        assert!((found / expected - 1.0).abs() < tolerance, "found {found}, expected {expected}");
    }

    #[test]
    fn values_agree_with_scipy() {
        // scipy 1.17.1: stats.t.ppf(0.975, d), 2*stats.t.sf(t, d), stats.f.ppf(0.975, a, b), stats.f.sf(f, a, b)
        close(t_975(29.0), 2.045229642132703, 1e-9);
        close(t_975(1.0), 12.706204736174694, 1e-9);
        close(t_two_sided(-2.2, 17.4), 0.04158659479381033, 1e-9);
        close(t_two_sided(40.0, 300.0), 2.8524180395311885e-122, 1e-9);
        close(f_upper(4.2, 3.0, 17.0), 0.021437857852397057, 1e-9);
        close(f_975(5.0, 112.0), 2.6818483810728453, 1e-9);
        // As many degrees of freedom as 84,138 judgements of 2,796 stimuli have.
        close(f_975(2795.0, 81342.0), 1.0540696832116905, 1e-6);
        close(f_975(81342.0, 2795.0), 1.055489070731133, 1e-6);
        close(t_two_sided(1.3, 40000.0), 0.19360846007159677, 1e-6);
    }

    #[test]
    fn what_has_no_distribution_has_no_probability() {
        assert_eq!(t_two_sided(1.0, 0.0), None);
        assert_eq!(t_two_sided(f64::NAN, 3.0), None);
        assert_eq!((t_975(-1.0), f_975(0.0, 3.0)), (None, None));
        assert_eq!((f_upper(-1.0, 1.0, 3.0), f_upper(f64::INFINITY, 1.0, 3.0)), (None, None));
    }
}
