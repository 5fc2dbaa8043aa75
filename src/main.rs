//! The `fabricate` command.

fn main() -> std::process::ExitCode {
    fabricate::cli::main()
}
