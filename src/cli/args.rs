//! The command line as clap sees it.
use std::path::PathBuf;

use clap::{Parser, Subcommand};

/// Turns a 3-D shape into flat pieces that a machine can cut and a person can assemble.
#[derive(Debug, Parser)]
#[command(name = "fabricate", version, propagate_version = true)]
pub(super) struct Args {
    #[command(subcommand)]
    pub(super) command: Command,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Run a job: a config, or a mesh with all defaults
    Run(Run),
    /// Read everything and run nothing: config, mesh, profiles, plan
    Check(Check),
    /// Write a commented config
    Init(Init),
    /// Say what is in a mesh, SVG, DXF or G-code file
    Inspect {
        /// The file
        file: PathBuf,
        /// One JSON document instead of a summary
        #[arg(long)]
        json: bool,
        /// Read a program as this machine would: its tool, speeds and bed
        #[arg(long, value_name = "PROFILE")]
        machine: Option<String>,
        /// Draw a drawing or a program as a PNG
        #[arg(long, value_name = "PNG")]
        picture: Option<PathBuf>,
    },
    /// Send programs to a machine over a serial port
    Send(Send),
    /// Write a small job that measures the kerf and the scale of a machine in a material
    Coupon(Coupon),
    /// List the serial ports of this machine
    Ports,
    /// List the built-in profiles, or show one
    Profiles {
        #[command(subcommand)]
        show: Option<Profiles>,
    },
    /// Print the JSON schema of the config, for editors
    Schema,
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page
    Man,
}

#[derive(Debug, clap::Args)]
pub(super) struct Run {
    /// A config (.toml) or a mesh (.obj, .stl, .ply, .off)
    #[arg(value_name = "CONFIG|MESH")]
    pub(super) job: PathBuf,
    /// Folder of the results, instead of `output.dir`
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Cut only this part again; may be given several times
    #[arg(long = "only", value_name = "PART")]
    pub(super) only: Vec<String>,
    /// Override a key of the config: --set coarsen.faces=2000
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(super) sets: Vec<String>,
    /// Compute from this stage on, even where the cache has results
    #[arg(long, value_name = "STAGE")]
    pub(super) from: Option<String>,
    /// Stop after this stage
    #[arg(long, value_name = "STAGE")]
    pub(super) to: Option<String>,
    /// Override the seed
    #[arg(long)]
    pub(super) seed: Option<u64>,
    /// Threads to use; all cores when absent
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) threads: Option<u16>,
    /// Print report.json to stdout instead of a summary
    #[arg(long)]
    pub(super) json: bool,
    /// No progress
    #[arg(long)]
    pub(super) quiet: bool,
    /// Run again whenever the config, the mesh or a profile changes, until Ctrl-C
    #[arg(long, conflicts_with = "send")]
    pub(super) watch: bool,
    /// Send the programs to the machine when all checks hold
    #[arg(long, requires = "port")]
    pub(super) send: bool,
    /// Serial port for --send (see `fabricate ports`)
    #[arg(long)]
    pub(super) port: Option<String>,
    /// Home the machine before --send
    #[arg(long, requires = "send")]
    pub(super) home: bool,
}

#[derive(Debug, clap::Args)]
pub(super) struct Send {
    /// G-code programs, sent one after another
    #[arg(value_name = "FILE", required_unless_present_any = ["home", "unlock", "zero"])]
    pub(super) files: Vec<PathBuf>,
    /// Machine profile: a built-in name or a path
    #[arg(long, value_name = "PROFILE")]
    pub(super) machine: String,
    /// Serial port (see `fabricate ports`)
    #[arg(long, required_unless_present = "dry_run")]
    pub(super) port: Option<String>,
    /// Read and measure the programs without opening the port
    #[arg(long)]
    pub(super) dry_run: bool,
    /// Let the board read the programs without moving ($C), and stop there
    #[arg(long)]
    pub(super) check: bool,
    /// Go once round the job with the tool off, and stop there
    #[arg(long)]
    pub(super) frame: bool,
    /// Home the machine first ($H)
    #[arg(long)]
    pub(super) home: bool,
    /// Unlock the machine first ($X); its position is then your responsibility
    #[arg(long)]
    pub(super) unlock: bool,
    /// Take the present place as the work zero (G54)
    #[arg(long)]
    pub(super) zero: bool,
    /// Go on with an interrupted job, by the journal beside the file
    #[arg(long, conflicts_with_all = ["check", "frame", "dry_run"])]
    pub(super) resume: bool,
    /// No progress
    #[arg(long)]
    pub(super) quiet: bool,
}

#[derive(Debug, clap::Args)]
pub(super) struct Coupon {
    /// Machine profile (see `fabricate profiles`)
    #[arg(long, default_value = "drag-knife-a3")]
    pub(super) machine: String,
    /// Material profile
    #[arg(long, default_value = "paper-200gsm")]
    pub(super) material: String,
    /// Folder to write into
    #[arg(long, default_value = "coupon", value_name = "DIR")]
    pub(super) out: PathBuf,
}

#[derive(Debug, clap::Args)]
pub(super) struct Check {
    /// A config (.toml) or a mesh
    #[arg(value_name = "CONFIG|MESH")]
    pub(super) job: PathBuf,
    /// Override a key of the config
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(super) sets: Vec<String>,
}

#[derive(Debug, clap::Args)]
pub(super) struct Init {
    /// Where to write `fabricate.toml`
    #[arg(default_value = ".")]
    pub(super) dir: PathBuf,
    /// Recipe of the job
    #[arg(long, default_value = "developable")]
    pub(super) recipe: String,
    /// Material profile
    #[arg(long, default_value = "paper-200gsm")]
    pub(super) material: String,
    /// Machine profile; the first that works the material when absent
    #[arg(long)]
    pub(super) machine: Option<String>,
    /// The mesh to name in the config; the only one in the folder when absent
    #[arg(long)]
    pub(super) mesh: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
pub(super) enum Profiles {
    /// Print a built-in profile, to copy and change
    Show {
        /// Its name
        name: String,
    },
}
