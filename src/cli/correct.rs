//! `study correct`

use super::{Console, Failure, study_folder};
use std::path::PathBuf;
use study_analysis::load;
use study_base::text::{ParticipantId, QuestionId, Untrusted};
use study_plan::protocol::{Answer, Seat};
use study_session::store::{self, AnswerCorrection, StudyFolder};

/// Arguments of `study correct`.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("what").required(true).args(["question", "id"]))]
pub(super) struct Args {
    /// Results folder of one study
    results: PathBuf,
    /// Participant, as in the results
    #[arg(add = super::completions::participants())]
    participant: String,
    /// Question whose answer is corrected
    #[arg(long, value_name = "ID")]
    question: Option<String>,
    /// Trial of the answer, as in ratings.csv; without it, a question that is asked once
    #[arg(long, value_name = "N", requires = "question")]
    trial: Option<u32>,
    /// Session of the answer [default: the last one]
    #[arg(long, value_name = "N", requires = "question")]
    session: Option<u32>,
    /// The right answer, as it would be typed; for a list, the numbers of its options
    #[arg(long, value_name = "ANSWER", requires = "question", allow_hyphen_values = true,
          required_unless_present_any = ["decline", "id"])]
    to: Option<String>,
    /// The question was declined, for the same reason
    #[arg(long, requires = "question", conflicts_with = "to")]
    decline: bool,
    /// The right id of the participant, where it was mistyped
    #[arg(long, value_name = "ID", conflicts_with_all = ["question", "to"])]
    id: Option<String>,
    /// Reason; it is recorded
    #[arg(long, value_name = "TEXT")]
    reason: String,
}

/// Corrects and says both values.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let participant = ParticipantId::new(args.participant.as_str()).map_err(Failure::input)?;
    let reason = study_folder::reason(&args.reason)?.to_owned();
    let study = store::one_study(&args.results)?;
    let said = match (&args.id, &args.question) {
        (Some(id), _) => of_id(&study, &participant, id, &reason, console)?,
        (None, Some(question)) => {
            let request = AnswerCorrection {
                participant,
                session: args.session,
                trial: args.trial,
                question: QuestionId::new(question.as_str()).map_err(Failure::input)?,
                to: args.to.clone().filter(|_| !args.decline),
                reason,
            };
            of_answer(&study, &request, console)?
        }
        // The parser asks for one of them.
        (None, None) => String::new(),
    };
    console.out(said)?;
    study_folder::refresh(&study, console)
}

fn of_id(
    study: &StudyFolder,
    from: &ParticipantId,
    to: &str,
    reason: &str,
    console: &mut Console,
) -> Result<String, Failure> {
    let to = ParticipantId::new(to).map_err(Failure::input)?;
    refuse_searcher(study, from, &to)?;
    for notice in study.correct_id(from, &to, reason, study_folder::now())? {
        console.say(notice);
    }
    Ok(format!(
        "{from} is {to} from now on; the journal has both. `study analyze` and copies elsewhere still have {from} until they are made again.\n"
    ))
}

/// Refuses the id of somebody who took part in the search that the study confirms: they cannot take part in it.
fn refuse_searcher(
    study: &StudyFolder,
    from: &ParticipantId,
    to: &ParticipantId,
) -> Result<(), Failure> {
    let confirms = load::frozen(study)?.protocol.confirms;
    let Some(search) = confirms.filter(|search| search.was_searcher(to)) else {
        return Ok(());
    };
    let sessions = study.sessions()?;
    let mut own = sessions.iter().filter(|s| s.participant == *from);
    if own.all(|s| s.seat.is_some_and(Seat::is_simulated)) {
        return Ok(());
    }
    Err(Failure::input(format!(
        "{to} took part in the search `{}`, which this study confirms, and cannot be {from}",
        Untrusted(&search.study)
    ))
    .hint(format!(
        "if it was them, leave their answers out: study participant RESULTS {from} --state excluded --reason TEXT"
    )))
}

fn of_answer(
    study: &StudyFolder,
    request: &AnswerCorrection,
    console: &mut Console,
) -> Result<String, Failure> {
    let loaded = load::frozen(study)?;
    let corrected = study.correct_answer(request, &loaded.protocol, study_folder::now())?;
    for notice in &corrected.notices {
        console.say(notice);
    }
    let shown = |answer: &Answer| match answer {
        Answer::Declined { .. } => "declined".to_owned(),
        answer => Untrusted(&answer.cell()).to_string(),
    };
    Ok(format!(
        "{}: {} was {} and is {} from now on; the journal and attempts.csv have both, with the reason.\n",
        request.participant,
        request.question,
        shown(&corrected.from),
        shown(&corrected.to)
    ))
}
