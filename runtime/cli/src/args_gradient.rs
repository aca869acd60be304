//! What a command line says of derivatives: results, and what they are differentiated in.

use clap::Args as ClapArgs;
use wfl_gradient::Request;

/// Derivatives of results.
#[derive(Clone, Debug, Default, ClapArgs)]
pub(crate) struct GradientArgs {
    /// Derivatives of these measures, with commas between: Fn, sum(misfit) or mean(misfit) over the steps, Fn at t=4.5
    /// (docs/gradients.md)
    #[arg(long, value_name = "RESULTS", requires = "with")]
    pub(crate) gradient: Option<String>,
    /// What they are differentiated in: E, fric, field k
    #[arg(long, value_name = "PARAMETERS", num_args = 1.., requires = "gradient")]
    pub(crate) with: Vec<String>,
    /// Derivatives to one side, too, where points are between two branches: +F to larger values, -F to smaller ones, F to both
    #[arg(long, value_name = "SIDES", requires = "gradient", allow_hyphen_values = true)]
    pub(crate) one_sided: Vec<String>,
}

impl GradientArgs {
    /// The request; `None` for a command without one.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub(crate) fn request(&self) -> Result<Option<Request>, String> {
        let Some(results) = &self.gradient else { return Ok(None) };
        let mut request = Request::read(results, &self.with.join(" "))?;
        if !self.one_sided.is_empty() {
            request.read_sides(&self.one_sided.join(","))?;
        }
        Ok(Some(request))
    }
}
