//! `wfl import`: an assembly string of a GetFEM script as statements of a scene.

use std::process::ExitCode;

use wfl_tasks::import::{self, Refused};

use crate::{
    args::ImportArgs,
    load::{out, print_all, say},
    prepared::EXIT_ERROR,
};

pub(crate) fn import(args: &ImportArgs) -> ExitCode {
    if args.text.trim().is_empty() {
        say("error: the assembly string is empty\n  = help: wfl import \"Grad_u.Grad_Test_u\"\n");
        return ExitCode::from(EXIT_ERROR);
    }
    let made = import::import(&args.text, args.on.as_deref());
    print_all(&made.diagnostics, &made.sources);
    match made.statements {
        Some(Ok(text)) => {
            out(&text);
            ExitCode::SUCCESS
        }
        Some(Err(refused)) => {
            told(&refused);
            ExitCode::from(EXIT_ERROR)
        }
        None => ExitCode::from(EXIT_ERROR),
    }
}

fn told(refused: &Refused) {
    say(&format!("error: the assembly string cannot be turned into statements: {}\n", refused.why));
    refused.help.iter().for_each(|h| say(&format!("  = help: {h}\n")));
    if let Some((messages, sources)) = &refused.messages {
        say("\n");
        print_all(messages, sources);
    }
}
