#!/bin/sh
# Makes the model files of both protocols again, from trajectory to realization:
#
#     sh protocols/identify.sh
#
# The simulated probe records switch B at 10 kHz; the recordings, 35 MB, go to a
# temporary folder, or to the one that RECORDINGS names. Seeds are fixed, so that
# every run makes the same recordings and the same files, to the last byte. STUDY
# names another program than the one that cargo builds, PROTOCOLS another folder
# than this one for the model files. Takes seconds.
#
# tests/identify_shipped.rs holds that what is shipped is what this makes.
set -eu
cd "$(dirname "$0")/.."

protocols=${PROTOCOLS:-protocols}

run() {
    ${STUDY:-cargo run --quiet --release --} "$@"
}

if [ -n "${RECORDINGS:-}" ]; then
    recordings=$RECORDINGS
    mkdir -p "$recordings"
else
    recordings=$(mktemp -d)
    trap 'rm -r "$recordings"' EXIT
fi

record() {
    run record "protocols/turn-signal/$1.toml" --plant b --rate 10000 --seed "$2" \
        --force --out "$recordings/$1.csv"
}

identify() {
    run identify "$recordings/training.csv" --validate "$recordings/validation-1.5hz.csv" \
        --resample point --lookup linear --start cold --sort ascending --force "$@"
}

record training 1
record validation-1.5hz 2

identify --lambda 0.9991,0.9993,0.9995,0.9997,0.9999 --dx 1 \
    --id 'lambda-{lambda}' --out "$protocols/turn-signal/models"

extended=$protocols/turn-signal-extended/models
identify --lambda 0.9991,0.9995,0.9999,0.99995,0.99998 --dx 1 --out "$extended"
identify --lambda 0.999 --dx 0.5 --out "$extended"
identify --lambda 0.9991 --dx 2 --out "$extended"
identify --lambda 0.9993 --dx 4 --out "$extended"
identify --lambda 0.9997 --dx 0.5 --id 'practice-lambda-{lambda}-dx-{dx}' --out "$extended"
identify --method static --dx 1 --id static --out "$extended"
identify --method spring --out "$extended"
