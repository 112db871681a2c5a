#!/bin/sh
# Reproduces the model files of this protocol from force curves measured by ThereminGoat
# (theremingoat.com), in the tidy form of jsejcksn/force-curves-tidy:
#
#     sh protocols/keyboard/identify.sh
#
# STUDY is the program to run instead of the one that cargo builds, MODELS the folder for the model
# files. tests/identify/import.rs compares the shipped files with these.
set -eu
cd "$(dirname "$0")"

curves=../../tests/data/switches
models=${MODELS:-models}
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT

run() {
    ${STUDY:-cargo run --quiet --release --} "$@"
}

switch() {
    run import force-curve "$curves/$2.csv" -o "$work/$1.csv" \
        --credit "measured by ThereminGoat (theremingoat.com)"
    run identify "$work/$1.csv" --method passive --dx 0.05 --id "$1" --out "$models" --force
}

switch jwk-bluey JWK_Bluey
switch haimu-silent-red Haimu_x_Geon_HG_Silent_Red
switch cherry-mx-purple Cherry_MX_Purple_1
switch bsun-panda BSUN_Dragon_Fruit_Panda_V2
switch ttc-orange-brown TTC_Orange_V2_Brown
switch zaku-ii Zaku_II_3
switch akko-blue Akko_Blue_V2
switch clickiez Clickiez_75g_Tactile
