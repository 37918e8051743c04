//! What every closed form has in common: `model!` turns a table of fields into a model.
//!
//! A model's file states its fields (kind, unit, bounds, start of a fit) and its formula over a [`Scalar`]; the
//! structure, its checks, its parameter vector and its derivatives follow from that.
//!
//! Derivatives: the channels of a colour never mix, so one variable of a dual number serves all three channels of a
//! field, and a model of F fields needs duals of F variables, however many parameters it has.

use super::{Parameter, Rgb};
use crate::math::dual::Dual;
use std::borrow::Cow;

/// A field of one number for all channels.
pub(super) type Number<S> = S;

/// A field of one number a channel.
pub(super) type Colour<S> = [S; 3];

/// What both kinds of fields can do: `f64`, one number for all channels, or [`Rgb`], one number a channel.
pub(super) trait Field: Copy {
    type Lifted<const N: usize>;

    /// The field as variable number `slot`.
    fn lift<const N: usize>(self, slot: usize) -> Self::Lifted<N>;

    /// Takes the field's numbers off a parameter vector.
    fn take(p: &mut impl Iterator<Item = f64>) -> Self;

    fn append_to(self, parameters: &mut Vec<f64>);

    /// One entry of a schema a number; `names` are those of the number, or of the three channels.
    fn describe(names: [&'static str; 4], unit: &'static str, bounds: (f64, f64), start: f64) -> Vec<Parameter>;

    /// Spreads the derivatives by variable `slot` over the gradient, one entry a number.
    fn scatter<'a, const N: usize>(slot: usize, value: &[Dual<N>; 3], d: &mut impl Iterator<Item = &'a mut Rgb>);
}

impl Field for f64 {
    type Lifted<const N: usize> = Dual<N>;

    fn lift<const N: usize>(self, slot: usize) -> Dual<N> {
        Dual::variable(self, slot)
    }

    fn take(p: &mut impl Iterator<Item = f64>) -> Self {
        p.next().unwrap_or(f64::NAN)
    }

    fn append_to(self, parameters: &mut Vec<f64>) {
        parameters.push(self);
    }

    fn describe(names: [&'static str; 4], unit: &'static str, bounds: (f64, f64), start: f64) -> Vec<Parameter> {
        vec![Parameter { name: Cow::Borrowed(names[0]), unit, bounds, start }]
    }

    fn scatter<'a, const N: usize>(slot: usize, value: &[Dual<N>; 3], d: &mut impl Iterator<Item = &'a mut Rgb>) {
        if let Some(entry) = d.next() {
            *entry = value.map(|channel| channel.derivatives[slot]);
        }
    }
}

impl Field for Rgb {
    type Lifted<const N: usize> = [Dual<N>; 3];

    fn lift<const N: usize>(self, slot: usize) -> [Dual<N>; 3] {
        self.map(|x| Dual::variable(x, slot))
    }

    fn take(p: &mut impl Iterator<Item = f64>) -> Self {
        std::array::from_fn(|_| f64::take(p))
    }

    fn append_to(self, parameters: &mut Vec<f64>) {
        parameters.extend(self);
    }

    fn describe(names: [&'static str; 4], unit: &'static str, bounds: (f64, f64), start: f64) -> Vec<Parameter> {
        names[1..].iter().map(|name| Parameter { name: Cow::Borrowed(name), unit, bounds, start }).collect()
    }

    fn scatter<'a, const N: usize>(slot: usize, value: &[Dual<N>; 3], d: &mut impl Iterator<Item = &'a mut Rgb>) {
        for (channel, entry) in d.take(3).enumerate() {
            *entry = [0.0; 3];
            entry[channel] = value[channel].derivatives[slot];
        }
    }
}

/// Declares a model: `Name = "identifier" { field: kind(unit, bounds, start), ... }`, where the kind is [`Number`] or
/// [`Colour`]. The file adds `fn formula(&self, wi, wo) -> [S; 3]` for any `S: Scalar`.
///
/// A model of several variants is declared as `Name of variant: Variant { ... }`; the variant, which is no parameter,
/// gives the identifier by `id()`.
macro_rules! model {
    ($(#[$doc:meta])* $name:ident = $id:literal { $($fields:tt)+ }) => {
        model!(@define [$(#[$doc])*] $name, [], |_model| $id, $($fields)+);
    };
    ($(#[$doc:meta])* $name:ident of $variant:ident: $kind:ident { $($fields:tt)+ }) => {
        model!(@define [$(#[$doc])*] $name, [$variant: $kind], |model| model.$variant.id(), $($fields)+);
    };
    (@define [$(#[$doc:meta])*] $name:ident, [$($variant:ident: $variants:ident)?], |$model:ident| $id:expr,
        $($field:ident: $kind:ident($unit:expr, $bounds:expr, $start:expr)),+ $(,)?
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name<S = f64> {
            $(
                #[doc = concat!("`", stringify!($field), "` of the model's formula.")]
                #[doc = concat!("Unit: ", $unit, ". Bounds: ", stringify!($bounds), ".")]
                pub $field: $crate::brdf::models::declare::$kind<S>,
            )+
            $(
                /// Which variant of the model this is.
                pub $variant: $variants,
            )?
        }

        impl $name {
            /// The model, if each of its parameters lies within its bounds.
            #[allow(clippy::too_many_arguments)]
            pub fn new(
                $($field: $crate::brdf::models::declare::$kind<f64>,)+
                $($variant: $variants,)?
            ) -> Result<Self, $crate::brdf::models::ModelError> {
                $crate::brdf::models::checked(Self { $($field,)+ $($variant,)? })
            }

            /// Names, units, bounds and starts of the parameters.
            pub(super) fn parameter_schema() -> Vec<$crate::brdf::models::Parameter> {
                use $crate::brdf::models::declare::Field;
                let mut all = Vec::new();
                $(all.extend(<$crate::brdf::models::declare::$kind<f64> as Field>::describe(
                    [
                        stringify!($field),
                        concat!(stringify!($field), ".r"),
                        concat!(stringify!($field), ".g"),
                        concat!(stringify!($field), ".b"),
                    ],
                    $unit,
                    $bounds,
                    $start,
                ));)+
                all
            }

            /// The checked model of a parameter vector of the schema's length.
            pub(super) fn shared(
                p: &[f64],
                $($variant: $variants,)?
            ) -> Result<std::sync::Arc<dyn $crate::brdf::models::AnalyticBrdf>, $crate::brdf::models::ModelError> {
                use $crate::brdf::models::declare::Field;
                let mut p = p.iter().copied();
                Ok(std::sync::Arc::new(Self::new($(<$crate::brdf::models::declare::$kind<f64> as Field>::take(&mut p),)+ $($variant,)?)?))
            }
        }

        impl $crate::brdf::models::AnalyticBrdf for $name {
            fn model(&self) -> &str {
                let $model = self;
                $id
            }

            fn schema(&self) -> Vec<$crate::brdf::models::Parameter> {
                Self::parameter_schema()
            }

            fn parameters(&self) -> Vec<f64> {
                use $crate::brdf::models::declare::Field;
                let mut all = Vec::new();
                $(self.$field.append_to(&mut all);)+
                all
            }

            fn value(&self, wi: $crate::math::Vec3, wo: $crate::math::Vec3) -> $crate::math::Rgb {
                self.formula(wi, wo)
            }

            fn reciprocal(&self) -> bool {
                true
            }

            fn as_differentiable(&self) -> Option<&dyn $crate::brdf::models::DifferentiableBrdf> {
                Some(self)
            }
        }

        impl $crate::brdf::models::DifferentiableBrdf for $name {
            fn value_and_gradient(
                &self,
                wi: $crate::math::Vec3,
                wo: $crate::math::Vec3,
                d: &mut [$crate::math::Rgb],
            ) -> $crate::math::Rgb {
                use $crate::brdf::models::declare::Field;
                const FIELDS: usize = [$(stringify!($field)),+].len();
                let mut slots = 0..FIELDS;
                let mut slot = || slots.next().unwrap_or_default();
                let lifted = $name { $($field: self.$field.lift::<FIELDS>(slot()),)+ $($variant: self.$variant,)? };
                let value = lifted.formula(wi, wo);
                let mut slots = 0..FIELDS;
                let mut slot = || slots.next().unwrap_or_default();
                let mut d = d.iter_mut();
                $(<$crate::brdf::models::declare::$kind<f64> as Field>::scatter(slot(), &value, &mut d);)+
                value.map(|channel| channel.value)
            }
        }
    };
}
pub(super) use model;
