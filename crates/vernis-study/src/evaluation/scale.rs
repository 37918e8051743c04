//! What was found in grades, 1 (worst) to 5 (best), told on the scale of the study.
//!
//! Learning and judging go on in grades; correlations, and whatever else does not change with the unit, stay as they are.
//! Scores, errors and widths change, and where larger scores are worse an error changes its sign and the shares below and above
//! an interval change places.

use super::agreement::{Agreement, Figure, Figures};
use super::bootstrap::{Difference, Interval};
use super::calibration::{Calibration, Coverage};
use super::records::{
    BenchmarkRecord, CurvePoint, DifferenceRecord, Judgement, MaterialResidual, MethodResidual, PredictionRecord,
};
use crate::dataset::Identical;
use vernis_metric::math::rating_scale::RatingScale;

impl BenchmarkRecord {
    /// A record in grades as one on `scale`.
    #[must_use]
    pub fn on_scale(mut self, scale: RatingScale) -> Self {
        debug_assert!(self.scale.is_grades(), "a record is put on a scale once");
        if scale.is_grades() {
            return self;
        }
        let of_metrics = self.metrics.iter_mut().flat_map(|m| &mut m.judgements);
        let of_ablation = self.ablation.iter_mut().flat_map(|a| &mut a.judgements);
        let of_curve = self.learning_curve.iter_mut().flat_map(|p| &mut p.judgements);
        of_metrics.chain(of_ablation).chain(of_curve).for_each(|j| judgement(j, scale));
        for fold in self.metrics.iter_mut().flat_map(|m| &mut m.folds) {
            fold.rmse = scale.width(fold.rmse);
        }
        self.differences.iter_mut().for_each(|d| difference(d, scale));
        self.curves.iter_mut().flat_map(|c| &mut c.points).for_each(|p| point(p, scale));
        self.residuals.iter_mut().for_each(|r| residual(r, scale));
        self.method_residuals.iter_mut().for_each(|r| method_residual(r, scale));
        self.calibration = self.calibration.map(|c| calibration(c, scale));
        self.predictions.iter_mut().for_each(|p| prediction(p, scale));
        self.identical = self.identical.map(|i| Identical { score: scale.stated(i.score), ..i });
        self.scale = scale;
        self
    }
}

fn judgement(judgement: &mut Judgement, scale: RatingScale) {
    let width = |rmse: f64| scale.width(rmse);
    judgement.agreement = Agreement { rmse: width(judgement.agreement.rmse), ..judgement.agreement };
    let found = judgement.intervals.rmse;
    let rmse = Interval { low: width(found.low), high: width(found.high) };
    judgement.intervals = Figures { rmse, ..judgement.intervals };
}

fn difference(record: &mut DifferenceRecord, scale: RatingScale) {
    if record.figure == Figure::Rmse {
        let Difference { difference, interval, .. } = record.paired;
        let interval = Interval { low: scale.width(interval.low), high: scale.width(interval.high) };
        record.paired = Difference { difference: scale.width(difference), interval, ..record.paired };
    }
}

fn point(point: &mut CurvePoint, scale: RatingScale) {
    (point.mos, point.mapped) = (scale.stated(point.mos), scale.score(point.mapped));
}

fn residual(residual: &mut MaterialResidual, scale: RatingScale) {
    residual.bias = scale.difference(residual.bias);
    residual.rms = scale.width(residual.rms);
    residual.worst_error = scale.difference(residual.worst_error);
}

fn method_residual(residual: &mut MethodResidual, scale: RatingScale) {
    residual.bias = scale.difference(residual.bias);
    residual.rms = scale.width(residual.rms);
    residual.interval = residual.interval.map(|i| {
        let [a, b] = [i.low, i.high].map(|end| scale.difference(end));
        Interval { low: a.min(b), high: a.max(b) }
    });
}

fn calibration(found: Calibration, scale: RatingScale) -> Calibration {
    let (below, above) = if scale.direction() > 0.0 { (found.below, found.above) } else { (found.above, found.below) };
    let unseen_method = found.unseen_method.map(|c| {
        let (below, above) = if scale.direction() > 0.0 { (c.below, c.above) } else { (c.above, c.below) };
        Coverage { below, above, mean_width: scale.width(c.mean_width), ..c }
    });
    Calibration { below, above, mean_width: scale.width(found.mean_width), unseen_method, ..found }
}

fn prediction(prediction: &mut PredictionRecord, scale: RatingScale) {
    prediction.mos = scale.stated(prediction.mos);
    prediction.predicted.values_mut().for_each(|mos| *mos = scale.score(*mos));
}
