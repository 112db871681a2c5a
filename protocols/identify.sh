#!/bin/sh
# Reproduces the model files of the protocols of the turn signal, from trajectory to realization:
#
#     sh protocols/identify.sh
#
# The simulated probe records switch B at 10 kHz; the recordings, 35 MB, are written to
# a temporary folder, or to the folder RECORDINGS. Seeds are fixed, so every run gives
# the same recordings and files, byte for byte. STUDY is the program to run instead of
# the one that cargo builds, PROTOCOLS the folder for the model files instead of this
# one. Takes a minute, nearly all of it for the mechanism.
#
# tests/identify/shipped.rs compares the shipped files with these.
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

# The files of the first two protocols are from before model files had coverage.
identify --lambda 0.9991,0.9993,0.9995,0.9997,0.9999 --dx 1 --without-coverage \
    --id 'lambda-{lambda}' --out "$protocols/turn-signal/models"

extended=$protocols/turn-signal-extended/models
identify --without-coverage --lambda 0.9991,0.9995,0.9999,0.99995,0.99998 --dx 1 --out "$extended"
identify --without-coverage --lambda 0.999 --dx 0.5 --out "$extended"
identify --without-coverage --lambda 0.9991 --dx 2 --out "$extended"
identify --without-coverage --lambda 0.9993 --dx 4 --out "$extended"
identify --without-coverage --lambda 0.9997 --dx 0.5 --id 'practice-lambda-{lambda}-dx-{dx}' --out "$extended"
identify --without-coverage --method static --dx 1 --id static --out "$extended"
identify --without-coverage --method spring --out "$extended"

passive=$protocols/turn-signal-passive/models
identify --lambda 0.9991,0.9993,0.9995,0.9997,0.9999 --dx 1 --id 'lambda-{lambda}' --out "$passive"
identify --method static --dx 1 --id static --out "$passive"
identify --method spring --out "$passive"
identify --method passive --dx 0.5 --id passive --out "$passive"
identify --method passive --dx 0.5 --id passive --out "$protocols/realism-search/models"
identify --method mechanism --dx 0.5 --id mechanism --out "$passive"

# The knob, in degrees and N·m at its axis
lever=20
for name in training validation; do
    run record "protocols/knob/$name.toml" --plant protocols/knob/knob.toml --rate 1000 \
        --seed 1 --force --out "$recordings/knob-rim-$name.csv"
    awk -v r=$lever -f protocols/knob/turn.awk "$recordings/knob-rim-$name.csv" \
        >"$recordings/knob-$name.csv"
done

identify_knob() {
    run identify "$recordings/knob-training.csv" --validate "$recordings/knob-validation.csv" \
        --columns 't=time,x=angle:deg,v=rate:deg/s,a=accel:deg/s²,f=torque:N·m' --lever $lever \
        --force --out "$protocols/knob/models" "$@"
}


identify_knob --method passive --dx 0.5 --id passive-1
identify_knob --method passive --dx 1 --id passive-3
identify_knob --method passive --dx 2 --id passive-6
identify_knob --method passive --dx 4 --id passive-11
identify_knob --method passive --dx 3 --id practice
identify_knob --method spring --id smooth
identify_knob --method mechanism --dx 0.5 --id mechanism
