//! Files of BRDFs that are only known: a message says what they are and what to do instead.

/// What a file with this extension (in lower case) is, if it is known and cannot be read; the text goes on from "a `.x` is".
pub fn what_it_is(extension: &str) -> Option<&'static str> {
    Some(match extension {
        "alta" => {
            "data or a fitted function of ALTA, which vernis does not read; write the parameters into a model in JSON, or data \
             into a MERL table"
        }
        "brdf" => {
            "a model in GLSL for BRDF Explorer, or scattered measurements of pbrt-v2, neither of which vernis reads; write the \
             parameters into a model in JSON; pbrt-v2 also reads MERL tables (.binary)"
        }
        "bparam" => "a set of parameters of BRDF Explorer, which vernis does not read; write them into a model in JSON",
        "astm" => {
            "a measurement in the text format of ASTM E1392, which vernis does not read: it holds scattered directions, often \
             of one plane; fit a model and write it in JSON"
        }
        "dat" => {
            "a table of numbers without a fixed layout (BRDF Explorer reads the anisotropic measurements of Ngan et al. 2005 from \
             it), which vernis does not read"
        }
        "axf" => {
            "a measurement in X-Rite's AxF, which vernis does not read; its own program exports parameters of models"
        }
        "btf" | "btfx" => {
            "a bidirectional texture, which varies over the surface; vernis compares homogeneous materials"
        }
        "xml" => "a scene of Mitsuba or BSDF of WINDOW and Radiance, which vernis does not read",
        "mtl" | "mtlx" | "mdl" | "gltf" | "glb" | "osl" | "pbrt" => {
            "a description of materials for a renderer, which vernis does not read; write the parameters into a model in JSON"
        }
        "exr" | "png" | "hdr" | "jpg" | "jpeg" | "tif" | "tiff" => {
            "a picture, which vernis does not take for a BRDF; UTIA and others publish anisotropic BRDFs as pictures, which have no \
             place in an isotropic one"
        }
        "merl" => "a MERL table by its name; if it is one, give it the extension .binary",
        "gz" | "xz" | "bz2" | "zst" | "7z" | "tar" => {
            "a compressed file or archive; unpack it first (archives in .zip are read in place)"
        }
        _ => return None,
    })
}
