//! Sinkhorn divergences of six pairs of analytic BRDFs, channel by channel.
//!
//! Origin: GeomLoss 0.3.1 in f64, `SamplesLoss("sinkhorn", p=2, blur=0.05, scaling=0.8, backend="tensorized")`, on the points
//! (0.1 theta_i/(pi/2), 0.1 theta_o/(pi/2), 0.1 phi_d/(2 pi), (f cos theta_i)^(1/4)) of the cell centres, weights 1/N; models as in
//! `transport_pairs.rs`. Nine digits were given.

use super::transport_pairs::Model;

/// A pair, its models by channel, and its divergences by grid.
pub struct Golden {
    pub name: &'static str,
    pub models: [[Model; 3]; 2],
    pub on_6x6x24: [f64; 3],
    pub on_9x9x36: [f64; 3],
}

const fn ggx(a: f64, kd: [f64; 3], f0: [f64; 3]) -> [Model; 3] {
    [
        Model::Ggx { a, kd: kd[0], f0: f0[0] },
        Model::Ggx { a, kd: kd[1], f0: f0[1] },
        Model::Ggx { a, kd: kd[2], f0: f0[2] },
    ]
}

const fn ward(a: f64, kd: [f64; 3], ks: [f64; 3]) -> [Model; 3] {
    [
        Model::Ward { a, kd: kd[0], ks: ks[0] },
        Model::Ward { a, kd: kd[1], ks: ks[1] },
        Model::Ward { a, kd: kd[2], ks: ks[2] },
    ]
}

const fn blinn(n: f64, kd: [f64; 3], ks: [f64; 3]) -> [Model; 3] {
    [
        Model::Blinn { n, kd: kd[0], ks: ks[0] },
        Model::Blinn { n, kd: kd[1], ks: ks[1] },
        Model::Blinn { n, kd: kd[2], ks: ks[2] },
    ]
}

pub const GOLDEN: [Golden; 6] = [
    Golden {
        name: "rough GGX, a 0.10 and 0.12",
        models: [ggx(0.1, [0.2, 0.1, 0.05], [0.04, 0.04, 0.04]), ggx(0.12, [0.2, 0.1, 0.05], [0.04, 0.04, 0.04])],
        on_6x6x24: [1.12697312e-05, 1.47169249e-05, 1.91825606e-05],
        on_9x9x36: [1.07494187e-05, 1.41900101e-05, 1.90344475e-05],
    },
    Golden {
        name: "GGX and Blinn",
        models: [ggx(0.3, [0.05, 0.3, 0.6], [0.04, 0.04, 0.04]), blinn(40.0, [0.05, 0.3, 0.6], [0.08, 0.08, 0.08])],
        on_6x6x24: [0.00549523624, 0.00250388611, 0.00140914825],
        on_9x9x36: [0.00548079563, 0.00248486756, 0.00139065067],
    },
    Golden {
        name: "near-identical GGX, a 0.2 and 0.2002",
        models: [ggx(0.2, [0.2, 0.2, 0.2], [0.04, 0.1, 0.9]), ggx(0.2002, [0.2, 0.2, 0.2], [0.04, 0.1, 0.9])],
        on_6x6x24: [2.52509902e-10, 8.19544097e-10, 6.34072306e-09],
        on_9x9x36: [3.0673454e-10, 8.87067505e-10, 6.44587692e-09],
    },
    Golden {
        name: "metals, a 0.02 and 0.03",
        models: [ggx(0.02, [0.01, 0.01, 0.01], [0.95, 0.64, 0.54]), ggx(0.03, [0.01, 0.01, 0.01], [0.95, 0.64, 0.54])],
        on_6x6x24: [0.00097909003, 0.000750596894, 0.000668880355],
        on_9x9x36: [0.000769019602, 0.000574388812, 0.000506527351],
    },
    Golden {
        name: "identical",
        models: [ggx(0.25, [0.1, 0.2, 0.3], [0.04, 0.04, 0.04]), ggx(0.25, [0.1, 0.2, 0.3], [0.04, 0.04, 0.04])],
        on_6x6x24: [0.0, 0.0, 0.0],
        on_9x9x36: [0.0, 0.0, 0.0],
    },
    Golden {
        name: "gold, GGX and Ward",
        models: [ggx(0.2, [0.0, 0.0, 0.0], [1.0, 0.78, 0.34]), ward(0.22, [0.01, 0.01, 0.01], [0.9, 0.7, 0.3])],
        on_6x6x24: [0.0155206208, 0.0124035048, 0.00525278729],
        on_9x9x36: [0.0155228332, 0.0124042386, 0.00529554791],
    },
];
