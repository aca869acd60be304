//! `wfl lsp`, `wfl completions` and `wfl man`: what is built with the feature `lsp`, which the default build has.

use std::{path::Path, process::ExitCode};

use crate::args::{CompletionsArgs, ManArgs};

#[cfg(feature = "lsp")]
mod built {
    use std::{io::Write as _, path::Path, process::ExitCode};

    use clap::CommandFactory as _;
    use clap_complete::generate;

    use crate::{
        args::{Args, CompletionsArgs, ManArgs, ShellName},
        load::say,
        prepared::EXIT_ERROR,
    };

    pub(super) fn lsp(program: &Path) -> ExitCode {
        let options = wfl_lsp::Options { program: Some(program.to_owned()), ..wfl_lsp::Options::default() };
        match wfl_lsp::serve_stdio(options) {
            Ok(()) => ExitCode::SUCCESS,
            Err(why) => {
                say(&format!("error: {why}\n"));
                ExitCode::from(EXIT_ERROR)
            }
        }
    }

    pub(super) fn completions(args: &CompletionsArgs) -> ExitCode {
        use clap_complete::Shell;
        let shell = match args.shell {
            ShellName::Bash => Shell::Bash,
            ShellName::Elvish => Shell::Elvish,
            ShellName::Fish => Shell::Fish,
            ShellName::Powershell => Shell::PowerShell,
            ShellName::Zsh => Shell::Zsh,
        };
        let mut text = Vec::new();
        generate(shell, &mut Args::command(), "wfl", &mut text);
        written(&text)
    }

    pub(super) fn man(args: &ManArgs) -> ExitCode {
        let mut program = Args::command();
        program.build();
        let page = match &args.command {
            None => Some(program),
            Some(name) => program.find_subcommand(name).cloned(),
        };
        let Some(page) = page else {
            let asked = args.command.as_deref().unwrap_or_default();
            say(&format!("error: there is no command `{asked}`\n  = help: wfl --help lists them\n"));
            return ExitCode::from(EXIT_ERROR);
        };
        let mut text = Vec::new();
        match clap_mangen::Man::new(page).render(&mut text) {
            Ok(()) => written(&text),
            Err(e) => {
                say(&format!("error: no page: {e}\n"));
                ExitCode::from(EXIT_ERROR)
            }
        }
    }

    /// Writes a text that we made; a closed pipe is not our problem.
    fn written(text: &[u8]) -> ExitCode {
        let mut stdout = std::io::stdout().lock();
        let _ = stdout.write_all(text).and_then(|()| stdout.flush());
        ExitCode::SUCCESS
    }
}

#[cfg(not(feature = "lsp"))]
mod built {
    use std::{path::Path, process::ExitCode};

    use crate::{
        args::{CompletionsArgs, ManArgs},
        load::say,
        prepared::EXIT_ERROR,
    };

    pub(super) fn lsp(_program: &Path) -> ExitCode {
        missing("the language server")
    }

    pub(super) fn completions(args: &CompletionsArgs) -> ExitCode {
        missing(&format!("the completions of {:?}", args.shell))
    }

    pub(super) fn man(_args: &ManArgs) -> ExitCode {
        missing("the man page")
    }

    fn missing(what: &str) -> ExitCode {
        say(&format!("error: this wfl is built without {what}: cargo install --path runtime/cli\n"));
        ExitCode::from(EXIT_ERROR)
    }
}

/// Serves an editor; `program` is what runs scenes for it.
pub(crate) fn lsp(program: &Path) -> ExitCode {
    built::lsp(program)
}

pub(crate) fn completions(args: &CompletionsArgs) -> ExitCode {
    built::completions(args)
}

pub(crate) fn man(args: &ManArgs) -> ExitCode {
    built::man(args)
}
