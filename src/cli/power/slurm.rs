//! Scripts for a Slurm cluster. Nothing is submitted.

use super::super::console::shell_command;
use super::super::{Console, Failure};
use super::{replace, shards, shown};
use std::fs;
use std::path::Path;
use std::time::Instant;
use study_analysis::power::{Plan, Unit, run_chunk};

/// Clusters often allow an array of about a thousand tasks.
const MOST_TASKS: u64 = 1000;

/// Writes the array script, the merge script and a script that submits both.
pub(super) fn write(
    plan: &Plan,
    units: &[Unit],
    dir: &Path,
    tasks: Option<u64>,
    console: &mut Console,
) -> Result<(), Failure> {
    // Files of others are not touched, and an array is submitted again, not written again.
    if fs::read_dir(dir).is_ok_and(|mut items| items.next().is_some()) {
        return Err(
            Failure::input(format!("{}: the folder is not empty", shown(dir)))
                .hint("choose a new one; `sh DIR/submit.sh` resumes an array that is there"),
        );
    }
    let all = units.len() as u64;
    let tasks = tasks.unwrap_or(MOST_TASKS).min(all).max(1);
    // The slowest design is the largest one.
    let slowest = units.iter().map(|u| u.0).max_by_key(|c| c.ratings());
    let start = Instant::now();
    if let Some(cell) = slowest {
        run_chunk(&plan.settings, &cell, 0);
    }
    let seconds = start.elapsed().as_secs_f64() * all.div_ceil(tasks) as f64 * 3.0;
    // Slurm counts in minutes.
    let minutes = (seconds / 60.0).ceil().clamp(1.0, 1e6) as u64;
    fs::create_dir_all(dir).map_err(|e| Failure::file(dir, &e))?;
    let dir = dir.canonicalize().map_err(|e| Failure::file(dir, &e))?;
    let here = std::env::current_dir().map_err(|e| Failure::file(Path::new("."), &e))?;
    let program = std::env::current_exe().map_err(|e| Failure::file(Path::new("study"), &e))?;
    let text = |path: &Path| path.display().to_string();
    let parts = dir.join("parts");
    let mut words = vec![text(&program), "power".to_owned()];
    words.extend(shards::common_arguments());
    let part = [
        &words[..],
        &[
            "--shards".to_owned(),
            tasks.to_string(),
            "--out".to_owned(),
            text(&parts),
            "--threads".to_owned(),
            "1".to_owned(),
        ],
    ]
    .concat();
    let merge = [
        &words[..],
        &[
            "--merge".to_owned(),
            text(&parts),
            "--out".to_owned(),
            text(&dir),
        ],
    ]
    .concat();
    let (here, log) = (
        shell_command(&[text(&here)]),
        shell_command(&[text(&dir.join("power-%A_%a.log"))]),
    );
    let array = format!(
        "#!/bin/sh\n#SBATCH --job-name=study-power\n#SBATCH --array=0-{}\n#SBATCH --ntasks=1\n\
         #SBATCH --cpus-per-task=1\n#SBATCH --mem=500M\n#SBATCH --time={minutes}\n\
         #SBATCH --output={log}\n\n\
         # Parts that are done are skipped: to resume, submit again.\ncd {here} || exit 1\n\
         srun {} --shard \"$SLURM_ARRAY_TASK_ID\"\n",
        tasks - 1,
        shell_command(&part),
    );
    let merge_log = shell_command(&[text(&dir.join("merge.log"))]);
    let merge = format!(
        "#!/bin/sh\n#SBATCH --job-name=study-power-merge\n#SBATCH --ntasks=1\n#SBATCH --mem=500M\n\
         #SBATCH --time=10\n#SBATCH --output={merge_log}\n\ncd {here} || exit 1\n{}\n",
        shell_command(&merge),
    );
    let submit = "#!/bin/sh\n# Submits the array, and the merge after it.\nset -eu\n\
                  cd \"$(dirname \"$0\")\"\n\
                  array=$(sbatch --parsable power.sbatch)\n\
                  merge=$(sbatch --parsable --dependency=\"afterok:${array%%;*}\" merge.sbatch)\n\
                  echo \"array $array, merge $merge\"\n";
    for (name, content) in [
        ("power.sbatch", array.as_str()),
        ("merge.sbatch", &merge),
        ("submit.sh", submit),
    ] {
        replace(&dir.join(name), content.as_bytes())?;
    }
    console.out(format!(
        "{}: power.sbatch ({tasks} tasks of about {minutes} min at most), merge.sbatch, submit.sh\n\
         Nothing is submitted. Next: sh {}\n",
        shown(&dir),
        shell_command(&[text(&dir.join("submit.sh"))])
    ))
}
