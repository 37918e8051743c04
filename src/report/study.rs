//! The statistics of a study's ratings as aligned text and as Markdown, from one list of blocks.

use super::markdown;
use super::tables::Table;
use crate::dataset::manifest;
use crate::panel::anova::Anova;
use crate::panel::intraclass::Intraclass;
use crate::panel::parameters::OF_STUDY;
use crate::panel::record::{
    BoxSet, IlluminationComparison, ManifoldCorrelation, ModelComparison, Panel, Spread, StudyRecord, TypeComparison,
};
use crate::panel::screening::{Criterion, GOLD_ACCURACY, GOLD_TOLERANCE, LEAST_SECONDS};
use crate::panel::sos;
use crate::panel::t_test::TTest;
use vernis_metric::io::counted;
use vernis_metric::math::quantile::Interval;
use vernis_metric::math::rating_scale::RatingScale;

const SYNTHETIC: &str =
    "SYNTHETIC observers: these ratings were simulated by a program. Nothing here says how people see.";

/// Stimuli of each end of the scale that are named.
const EXTREMES: usize = 3;

/// A part of a report.
pub(super) enum Block {
    Heading(&'static str),
    Text(String),
    Table(Table),
}

/// For a terminal.
pub fn text(record: &StudyRecord) -> String {
    let parts = blocks(record).into_iter().map(|block| match block {
        Block::Heading(h) => format!("\n{h}\n{}\n", "-".repeat(h.chars().count())),
        Block::Text(t) => format!("{t}\n"),
        Block::Table(t) => format!("\n{}", t.to_text()),
    });
    format!("{}\n{}", title(record), parts.collect::<String>())
}

/// As a file of its own.
pub fn markdown(record: &StudyRecord) -> String {
    let parts = blocks(record).into_iter().map(|block| match block {
        Block::Heading(h) => format!("## {h}\n\n"),
        Block::Text(t) => format!("{}\n\n", markdown::text(&t)),
        Block::Table(t) => format!("{}\n", t.to_markdown()),
    });
    let mut page = format!("# {}\n\n{}", markdown::text(&title(record)), parts.collect::<String>());
    page += "## Provenance\n\n";
    let command = markdown::code(&record.command);
    page += &format!("* command: {command}\n* vernis {}, seed {}\n", markdown::text(&record.version), record.seed);
    for (file, hash) in &record.data {
        page += &format!("* {}: SHA-256 {}\n", markdown::code(file), markdown::text(hash));
    }
    page
}

pub(super) fn title(record: &StudyRecord) -> String {
    format!("Ratings of {}{}", record.study, if record.synthetic { " (SYNTHETIC)" } else { "" })
}

pub(super) fn blocks(record: &StudyRecord) -> Vec<Block> {
    let mut blocks = Vec::new();
    if record.synthetic {
        blocks.push(Block::Text(SYNTHETIC.into()));
    }
    blocks.push(Block::Text(what_was_rated(record)));
    if let Some(panel) = &record.panel {
        blocks.extend([Block::Heading("Raters"), Block::Text(raters(panel, record.scale))]);
    }
    blocks.push(Block::Heading("Mean opinion scores"));
    blocks.push(Block::Text(spread(record)));
    blocks.push(Block::Table(extremes(record)));
    blocks.extend(agreement(record));
    if let Some(types) = &record.material_types {
        blocks.extend([Block::Heading("Material types"), Block::Table(type_table(types))]);
    }
    if let Some(both) = &record.illumination {
        blocks.extend([
            Block::Heading("Illuminations"),
            Block::Text(correlations(both)),
            Block::Table(light_table(both)),
        ]);
    }
    blocks.extend(models(record));
    let anovas: Vec<&Anova> = record.anova_two_way.iter().chain(&record.anova_three_way).collect();
    if !anovas.is_empty() {
        blocks.push(Block::Heading("Analysis of variance"));
        blocks.extend(anovas.into_iter().map(|a| Block::Table(anova_table(a))));
    }
    blocks.push(Block::Heading("Distributions"));
    blocks.extend(record.boxes.iter().map(|set| Block::Table(box_table(set))));
    if !record.missing.is_empty() {
        blocks.push(Block::Heading("Left out"));
        blocks.extend(record.missing.iter().map(|m| Block::Text(format!("{}: {}.", m.what, m.why))));
    }
    blocks
}

fn what_was_rated(record: &StudyRecord) -> String {
    let lights = match record.illuminations.as_slice() {
        [] => "the illumination is not stated".to_owned(),
        [one] => format!("under {one}"),
        [main, others @ ..] => {
            format!("under {main} and {}; unless stated otherwise, under {main} alone", others.join(", "))
        }
    };
    let part = if record.found == record.known || record.panel.is_some() {
        String::new()
    } else {
        format!(" Of the study's {}, {} are here.", counted(record.known, "rated pair"), record.found)
    };
    format!(
        "{} of {} and {}, {lights}.{part}",
        counted(record.opinions.len(), "stimulus"),
        counted(record.materials, "material"),
        counted(record.methods, "method")
    )
}

/// Of a right answer to a control question.
fn tolerance(scale: RatingScale) -> String {
    if scale.is_grades() {
        return format!("{GOLD_TOLERANCE} grade");
    }
    format!("{} points", scale.show(scale.width(GOLD_TOLERANCE)))
}

fn raters(panel: &Panel, scale: RatingScale) -> String {
    let each = |what: &str, m: Option<crate::panel::moments::MeanAndDeviation>| {
        m.map_or(String::new(), |m| format!(" {what}: {:.1} on average (SD {:.1}).", m.mean, m.deviation))
    };
    let criteria = [
        (
            Criterion::Gold,
            format!("fewer than {:.0} % of control questions within {}", 100.0 * GOLD_ACCURACY, tolerance(scale)),
        ),
        (Criterion::Time, format!("less than {LEAST_SECONDS} s per answer")),
        (Criterion::Outlier, "outliers of ITU-R BT.500-13, annex 2, 2.3.1".to_owned()),
    ];
    let checks = criteria.map(|(criterion, what)| {
        let rejects = if panel.rejecting.contains(&criterion) { "rejected" } else { "reported, not rejected" };
        format!("{what}: {} ({rejects})", panel.failing(criterion))
    });
    let rejected: Vec<&str> = panel.rejected().map(|p| p.name.as_str()).collect();
    let names = if rejected.is_empty() { String::new() } else { format!(" Rejected: {}.", rejected.join(", ")) };
    format!(
        "{} of {}, of {} who took part.{}{}\nScreening: {}.{names}",
        counted(panel.judgements, "judgement"),
        counted(panel.participants, "participant"),
        panel.screened.len(),
        each("Judgements per participant", panel.judgements_each),
        each("Raters per stimulus", panel.raters_each),
        checks.join("; "),
    )
}

fn spread(record: &StudyRecord) -> String {
    let widths: Vec<f64> = record.opinions.iter().filter_map(|o| o.opinion.width()).collect();
    let half = 0.5 * widths.iter().sum::<f64>() / widths.len().max(1) as f64;
    let scale = record.scale;
    let ends = match scale {
        scale if scale.is_grades() => "1 is very poor, 5 excellent.".to_owned(),
        scale if scale.is_open() => {
            let (best, worst) = (scale.best(), scale.worst());
            format!(
                "{best} is best; the scale has no worst end: {worst} stands for it, the worst rating rounded outwards."
            )
        }
        scale => format!("{} is worst, {} best.", scale.worst(), scale.best()),
    };
    let how = &record.intervals;
    match record.spread {
        Spread::Unknown => format!("{ends} {how}"),
        _ => format!("{ends} 95 % intervals of single means are +-{half:.2} on average ({how})."),
    }
}

fn extremes(record: &StudyRecord) -> Table {
    let mut order: Vec<&_> = record.opinions.iter().collect();
    order.sort_by(|a, b| b.opinion.mos.total_cmp(&a.opinion.mos));
    let rest = order.len().saturating_sub(EXTREMES).max(EXTREMES.min(order.len()));
    let mut table = Table::new("Highest and lowest", &["stimulus", "MOS", "95 % interval", "SD"]);
    for o in order.iter().take(EXTREMES).chain(&order[rest..]) {
        let s = &o.stimulus;
        let light = s.illumination.as_ref().map_or(String::new(), |i| format!(", {i}"));
        table.rows.push(vec![
            format!("{}, {}{light}", s.material, s.method),
            number(o.opinion.mos),
            interval(o.opinion.interval),
            o.opinion.deviation.map_or("-".into(), number),
        ]);
    }
    table
}

fn agreement(record: &StudyRecord) -> Vec<Block> {
    let mut blocks = vec![Block::Heading("Agreement")];
    if let Some(s) = &record.split_half {
        blocks.push(Block::Text(format!(
            "Halves of the panel, {}: Pearson {:.3} (SD {:.3}), Spearman {:.3} (SD {:.3}).",
            counted(s.splits, "random split"),
            s.pearson.mean,
            s.pearson.deviation,
            s.spearman.mean,
            s.spearman.deviation
        )));
    }
    if let Some(e) = &record.expected_reliability {
        blocks.push(Block::Text(format!(
            "EXPECTED from the assumed noise, not measured: halves of the panel correlate with {:.3} (Pearson), and {:.3} of \
             the variance of the means is signal.",
            e.split_half_pearson, e.signal
        )));
    }
    let mut table = Table::new(
        "Intra-class correlations [95 % interval]",
        &["model", "one score", "mean of k", "k", "F", "degrees of freedom", "p"],
    );
    let models = [("one way, ICC(1,.)", &record.intraclass_one_way), ("two way, ICC(2,.)", &record.intraclass_two_way)];
    for (name, icc) in models {
        let Some(icc) = icc else { continue };
        table.rows.push(intraclass_row(name, icc));
    }
    if !table.rows.is_empty() {
        blocks.push(Block::Table(table));
    }
    if let Some(s) = &record.sos {
        blocks.push(Block::Text(format!(
            "SOS: variance of the scores = {:.3} {} ({}), root mean square error of the SD {:.2}.",
            s.a,
            interval(s.interval),
            sos::formula(record.scale),
            s.rmse
        )));
    }
    blocks
}

fn intraclass_row(name: &str, icc: &Intraclass) -> Vec<String> {
    let cell = |c: &crate::panel::intraclass::Correlation| {
        format!("{:.3} [{:.3}, {:.3}]", c.value, c.interval.low, c.interval.high)
    };
    vec![
        name.to_owned(),
        cell(&icc.single),
        cell(&icc.average),
        format!("{:.1}", icc.raters),
        format!("{:.2}", icc.f),
        format!("{:.0}, {:.0}", icc.freedom[0], icc.freedom[1]),
        probability(icc.p),
    ]
}

const TEST_COLUMNS: [&str; 8] =
    ["of", "n", "first", "second", "difference [95 % interval]", "t", "degrees of freedom", "p"];

fn test_row(name: &str, t: &TTest) -> Vec<String> {
    let n = if t.numbers[0] == t.numbers[1] {
        t.numbers[0].to_string()
    } else {
        format!("{} and {}", t.numbers[0], t.numbers[1])
    };
    vec![
        name.to_owned(),
        n,
        number(t.means[0]),
        number(t.means[1]),
        format!("{:+.3} {}", t.difference, interval(Some(t.interval))),
        format!("{:.2}", t.t),
        format!("{:.1}", t.freedom),
        probability(t.p),
    ]
}

fn type_table(types: &TypeComparison) -> Table {
    let [a, b] = &types.types;
    let by_material = types.by_material.map_or(String::new(), |i| {
        format!("; by bootstrap of materials, the difference of MOS is within {}", interval(Some(i)))
    });
    let mut table = Table::new(format!("{a} (first) and {b} (second), Welch's t-test{by_material}"), &TEST_COLUMNS);
    table.rows.push(test_row("MOS", &types.mos));
    table.rows.extend(types.deviation.iter().map(|t| test_row("SD of the scores", t)));
    table.rows.extend(types.hidden_references.iter().map(|t| test_row("MOS of hidden references", t)));
    table
}

fn correlations(both: &IlluminationComparison) -> String {
    format!(
        "MOS of the two correlate: Pearson {:.3} {}, Spearman {:.3} {} (95 % by bootstrap of materials).",
        both.pearson,
        interval(both.pearson_interval),
        both.spearman,
        interval(both.spearman_interval)
    )
}

fn light_table(both: &IlluminationComparison) -> Table {
    let [a, b] = &both.illuminations;
    let title = format!("{a} (first) and {b} (second), paired t-test of what was rated under both");
    let mut table = Table::new(title, &TEST_COLUMNS);
    table.rows.push(test_row("MOS", &both.mos));
    table.rows.extend(both.deviation.iter().map(|t| test_row("SD of the scores", t)));
    table.rows.extend(both.hidden_references.iter().map(|t| test_row("MOS of hidden references", t)));
    table
}

/// Models: their parameters where the paper counts them, pairwise tests, and the manifold's samples.
fn models(record: &StudyRecord) -> Vec<Block> {
    let mut blocks: Vec<Block> = parameters(record).map(Block::Table).into_iter().collect();
    blocks.extend(record.models.iter().flat_map(pairwise));
    blocks.extend(record.manifold.as_ref().map(|found| Block::Text(format!("{}.", manifold(found)))));
    if !blocks.is_empty() {
        blocks.insert(0, Block::Heading("Models"));
    }
    blocks
}

/// Of the published study alone: methods of other studies may go by the same names.
fn parameters(record: &StudyRecord) -> Option<Table> {
    let rated = |family: &str| record.opinions.iter().any(|o| o.stimulus.method_family == family);
    let mut table = Table::new(
        "Parameters of the models, as section 5.5 of Lavoué et al. 2021 counts them",
        &["model", "in the ratings", "parameters", ""],
    );
    for model in OF_STUDY.iter().filter(|model| manifest::NAMES.contains(&record.study.as_str()) && rated(model.family))
    {
        let number = model.parameters.map_or("-".to_owned(), |n| n.to_string());
        table.rows.push([model.model, model.family, &number, model.note].map(str::to_owned).into());
    }
    (!table.rows.is_empty()).then_some(table)
}

fn pairwise(found: &ModelComparison) -> Vec<Block> {
    let Some(first) = found.models.first() else { return Vec::new() };
    let with_first = found.pairs.iter().filter(|pair| pair.models.contains(first));
    let largest =
        with_first.map(|pair| pair.holm_p).fold(None, |most: Option<f64>, p| Some(most.map_or(p, |m| m.max(p))));
    let left_out = found.left_out.as_ref().map_or(String::new(), |words| format!(" {words}."));
    let mut blocks = vec![Block::Text(format!(
        "Of {}, {first} has the best mean{}. Of several fits of a model to a material the better one counts.{left_out}",
        counted(found.models.len(), "model"),
        largest.map_or(String::new(), |p| format!(", p at most {} against each other one", probability(p)))
    ))];
    if !found.pairs.is_empty() {
        let title = format!(
            "{} of models, paired t-tests on the materials that both were fitted to, p corrected by Holm",
            counted(found.pairs.len(), "pair")
        );
        let columns: Vec<&str> = TEST_COLUMNS.into_iter().chain(["p, corrected"]).collect();
        let mut table = Table::new(title, &columns);
        for pair in &found.pairs {
            let mut row = test_row(&pair.models.join(" - "), &pair.mos);
            row.push(probability(pair.holm_p));
            table.rows.push(row);
        }
        blocks.push(Block::Table(table));
    }
    blocks
}

/// The correlation of figure 11, without its end.
pub(super) fn manifold(found: &ManifoldCorrelation) -> String {
    format!(
        "Samples of the manifold, {} at (i/{})^5 of its diameter from the reference: MOS and distance correlate, Pearson {:.3} {}, \
         Spearman {:.3} {} (95 % by bootstrap of materials; below 0, because opinions fall with the distance)",
        counted(found.stimuli, "stimulus"),
        found.steps,
        found.pearson,
        interval(found.pearson_interval),
        found.spearman,
        interval(found.spearman_interval)
    )
}

fn anova_table(anova: &Anova) -> Table {
    let main: Vec<&str> = anova.terms.iter().filter(|t| t.factors.len() == 1).map(|t| t.factors[0].as_str()).collect();
    let empty = match anova.empty_cells {
        0 => String::new(),
        n => format!(", {n} of {} without a row", counted(anova.cells, "combination")),
    };
    let title = format!(
        "MOS by {}: Type {} sums of squares, {}{empty}",
        main.join(" x "),
        anova.sums_of_squares,
        counted(anova.rows, "row")
    );
    let mut table =
        Table::new(title, &["term", "sum of squares", "degrees of freedom", "F", "p", "partial eta squared"]);
    for t in &anova.terms {
        table.rows.push(vec![
            t.factors.join(" x "),
            format!("{:.3}", t.sum_of_squares),
            t.freedom.to_string(),
            format!("{:.2}", t.f),
            probability(t.p),
            format!("{:.3}", t.partial_eta_squared),
        ]);
    }
    let rest = ["-", "-", "-"].map(str::to_owned);
    let (sum, freedom) = (format!("{:.3}", anova.residual_sum_of_squares), anova.residual_freedom.to_string());
    table.rows.push(["residual".to_owned(), sum, freedom].into_iter().chain(rest).collect());
    table
}

fn box_table(set: &BoxSet) -> Table {
    let columns =
        ["of", "n", "mean [95 % by material]", "median", "quartiles", "whiskers", "outliers", "median interval width"];
    let note = set.note.as_ref().map_or(String::new(), |note| format!(". {note}"));
    let mut table = Table::new(format!("{}{note}", set.title), &columns);
    for b in &set.boxes {
        let range = |r: [f64; 2]| format!("{} to {}", number(r[0]), number(r[1]));
        table.rows.push(vec![
            if b.levels.is_empty() { "all".to_owned() } else { b.levels.join(", ") },
            b.mos.n.to_string(),
            format!("{} {}", number(b.mean), interval(b.mean_interval)).trim_end().to_owned(),
            number(b.mos.median),
            range(b.mos.quartiles),
            range(b.mos.whiskers),
            b.mos.outliers.len().to_string(),
            b.interval_width.as_ref().map_or("-".into(), |w| number(w.median)),
        ]);
    }
    table
}

fn number(x: f64) -> String {
    format!("{x:.2}")
}

fn interval(i: Option<Interval>) -> String {
    i.map_or("-".to_owned(), |i| format!("[{:.2}, {:.2}]", i.low, i.high))
}

/// Three digits, or the order of magnitude where these would be zeros.
fn probability(p: f64) -> String {
    if p < 1e-300 {
        "< 1e-300".to_owned()
    } else if p < 1e-3 {
        format!("{p:.1e}")
    } else {
        format!("{p:.3}")
    }
}
