#!/bin/sh
# Makes the model files of both protocols again from the recordings in tests/data.
# tests/identify_shipped.rs holds that what is shipped is what this makes.
set -eu
cd "$(dirname "$0")/.."

study() {
    ${STUDY:-cargo run --quiet --} identify tests/data/recordings/training_a.csv \
        --validate validation-1.5hz=tests/data/recordings/validation_a.csv \
        --resample point --lookup linear --start cold --sort ascending --force "$@"
}

study --lambda 0.9991,0.9993,0.9995,0.9997,0.9999 --dx 1 \
    --id 'lambda-{lambda}' --out protocols/turn-signal/models

extended=protocols/turn-signal-extended/models
study --lambda 0.9991,0.9993,0.9995,0.9997,0.9999 --dx 1 --out $extended
study --lambda 0.99 --dx 0.5,1 --out $extended
study --lambda 0.999 --dx 0.5 --out $extended
study --lambda 0.998 --dx 2 --id 'practice-lambda-{lambda}-dx-{dx}' --out $extended
study --method static --dx 1 --id static --out $extended
study --method spring --out $extended
