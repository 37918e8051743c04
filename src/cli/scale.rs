//! On which scale the ratings of a user's file are: what every command that takes a study asks in the same way.

use crate::dataset::DeclaredScale;
use clap::Args;

/// The scale of a file of ratings.
#[derive(Args)]
pub struct ScaleArgs {
    /// Scale of the ratings in a file of your own: mos (1 to 5), jod (10 is best, no worst end), dmos (0 is best, larger is
    /// worse, no worst end), or both ends, such as worst=0,best=100 [default: what the file declares, else mos].
    #[arg(long = "scale", value_name = "SCALE")]
    pub declared: Option<DeclaredScale>,
}

impl ScaleArgs {
    /// The same option, for the command that gives the same result again.
    pub fn option(&self) -> String {
        self.declared.map_or(String::new(), |scale| format!(" --scale {scale}"))
    }
}
