//! `partpose completions` and `partpose man`: what a shell and `man` need to know of the commands.

use std::path::PathBuf;

use clap::Command;
use clap_complete::Shell;
use partpose::files;

use crate::report::{self, Outcome, note};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  partpose completions bash > ~/.local/share/bash-completion/completions/partpose
  partpose completions fish > ~/.config/fish/completions/partpose.fish
  partpose completions zsh > ~/.zfunc/_partpose")]
pub(crate) struct Arguments {
    /// Shell that the script is for
    #[arg(value_enum)]
    shell: Shell,
}

#[derive(clap::Args)]
#[command(after_help = "Example:
  partpose man --out ~/.local/share/man/man1")]
pub(crate) struct ManArguments {
    /// Folder to write a page a command to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Prints the script.
pub(crate) fn run(arguments: &Arguments, mut command: Command) -> anyhow::Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "partpose", &mut script);
    report::data(&String::from_utf8_lossy(&script))?;
    Ok(Outcome::Done)
}

/// Writes `partpose.1`, `partpose-fit.1` and so on.
pub(crate) fn man(arguments: &ManArguments, command: Command) -> anyhow::Result<Outcome> {
    let mut pages = Vec::new();
    collect(command.disable_help_subcommand(true), "partpose", &mut pages);
    for (name, page) in &pages {
        files::write(&arguments.out.join(format!("{name}.1")), page)?;
    }
    note(format_args!("wrote {} pages to `{}`", pages.len(), arguments.out.display()));
    Ok(Outcome::Done)
}

fn collect(command: Command, name: &str, pages: &mut Vec<(String, Vec<u8>)>) {
    let subcommands: Vec<Command> = command.get_subcommands().cloned().collect();
    let mut page = Vec::new();
    // Writing to memory does not fail.
    let page_of = clap_mangen::Man::new(command.display_name(name.to_owned()));
    if page_of.render(&mut page).is_ok() {
        pages.push((name.to_owned(), page));
    }
    for subcommand in subcommands {
        let name = format!("{name}-{}", subcommand.get_name());
        collect(subcommand, &name, pages);
    }
}
