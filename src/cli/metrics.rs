//! `vernis metrics`: what there is to measure with.

use super::{Shared, print, workspace};
use anyhow::Result;
use clap::Args;
use serde_json::json;
use vernis_image::metric::ImageRegistry;
use vernis_image::picture::Encoding;

/// List the metrics, those on BRDFs and those on pictures.
#[derive(Args)]
#[command(after_help = "Examples:\n  vernis metrics\n  vernis metrics --json")]
pub struct MetricsArgs {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(shared: &Shared, args: MetricsArgs) -> Result<()> {
    let registry = workspace::registry(shared)?;
    if args.json {
        let on_brdfs = registry
            .iter()
            .map(|m| {
                let p = m.properties();
                json!({
                    "name": m.name(), "version": m.version(), "summary": p.summary, "unit": p.unit, "symmetric": p.symmetric,
                    "usable_as_loss": p.usable_as_loss, "source": p.source, "on": "brdfs",
                })
            });
        let pictures = ImageRegistry::standard();
        let on_pictures = pictures.iter().map(|m| {
            let p = m.properties();
            let encodings: Vec<_> = p.encodings.iter().map(|e| encoding(*e)).collect();
            json!({
                "name": m.name(), "version": m.version(), "summary": p.quality, "unit": p.unit,
                "larger_is_better": p.larger_is_better, "distance": p.distance, "pictures": encodings, "map": p.has_map,
                "source": p.source, "on": "pictures",
            })
        });
        let all: Vec<_> = on_brdfs.chain(on_pictures).collect();
        return print(serde_json::to_string_pretty(&all)? + "\n");
    }
    let width = registry.iter().map(|m| m.name().len()).max().unwrap_or(0);
    let mut text = String::new();
    for metric in registry.iter() {
        let p = metric.properties();
        text += &format!("{:width$}  version {}: {} [{}]\n", metric.name(), metric.version(), p.summary, p.unit);
    }
    text += "\nOther members of the metrics on graphs: ot[p=2,alpha=0.1,blur=0.05,scaling=0.8,phi=t^1/4,gamma=0.25,grid=45x45x180],\n";
    text += "energy[phi=t^1/3,alpha=0.1,gamma=0.25], mmd-gaussian[blur=0.05,...], mmd-laplacian[...]; phi is t, t^1/2, t^1/3, t^1/4\n";
    text += "or log:eta=E. Options that are not given are those of the plain name.\n";
    text += "\n`all-lp` stands for the 36 Lp metrics of Lavoué et al. 2021. 0 is identical, larger is worse.\n";
    text += "\nstimulus[METRIC] renders both BRDFs in the study's scene and compares the pictures by a metric on pictures (below):\n";
    text += "stimulus[ssim,camera=same,light=study,shape=study,size=193x300,samples=64,bounces=8,seed=0,tone=exrdisplay,exposure=0]; camera is\n";
    text += "same, offset or offset-minus-hidden, light study, grace, uffizi, white, lamps or a probe, shape study, sphere, blob or a mesh.\n";
    text += "`all-stimulus`, `all-stimulus-offset` and `all-stimulus-offset-minus-hidden` stand for all metrics on codes by one camera, by the\n";
    text += "study's two cameras, and less the value of the hidden reference.\n";
    text += "\nOn pictures (vernis compare-images):\n";
    let pictures = ImageRegistry::standard();
    let width = pictures.names().map(str::len).max().unwrap_or(0);
    for metric in pictures.iter() {
        let p = metric.properties();
        let encodings: Vec<_> = p.encodings.iter().map(|e| encoding(*e)).collect();
        let (name, version) = (metric.name(), metric.version());
        text += &format!("{name:width$}  version {version}: {} [{}], {}\n", p.quality, p.unit, encodings.join(" and "));
    }
    print(text)
}

/// What a metric on pictures takes.
fn encoding(encoding: Encoding) -> &'static str {
    match encoding {
        Encoding::Srgb => "codes",
        Encoding::Linear => "light",
    }
}
