//! Completions of a program's command line, for shells.

use clap::CommandFactory;
use clap_complete::{Shell, generate};

use crate::print;

/// For which shell completions are printed.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Completions {
    /// Shell that completes the program's command line
    #[arg(value_enum)]
    shell: Shell,
}

impl Completions {
    /// Prints the completions of the program with the arguments `A` to the standard output.
    ///
    /// # Errors
    /// If the output cannot be written.
    pub fn print<A: CommandFactory>(self) -> anyhow::Result<()> {
        print(&script::<A>(self.shell)?)
    }
}

fn script<A: CommandFactory>(shell: Shell) -> anyhow::Result<String> {
    let mut command = A::command();
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    generate(shell, &mut command, name, &mut script);
    Ok(String::from_utf8(script)?)
}

#[cfg(test)]
mod tests {
    use clap::{Parser, ValueEnum};

    use super::*;
    use crate::Verbosity;

    #[derive(Parser)]
    #[command(name = "cofix-test")]
    struct Arguments {
        #[command(flatten)]
        verbosity: Verbosity,
    }

    #[test]
    fn every_shell_has_the_options_and_the_values_of_a_choice() {
        for shell in Shell::value_variants() {
            let script = script::<Arguments>(*shell).unwrap();
            assert!(script.contains("cofix-test") && script.contains("log-format"), "{shell}: {script}");
        }
        assert!(script::<Arguments>(Shell::Bash).unwrap().contains("text json"));
    }
}
