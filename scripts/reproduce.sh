#!/usr/bin/env bash
# Carves, evaluates and measures everything that docs/results.md quotes.
#   scripts/reproduce.sh VKITTI_1_3_1_DIR PNP_PROBLEMS_DIR OUT
set -euo pipefail
[ $# -eq 3 ] || { echo "usage: scripts/reproduce.sh VKITTI_1_3_1_DIR PNP_PROBLEMS_DIR OUT"; exit 2; }
data=$1 problems=$2 out=$3
cd "$(dirname "$0")/.."
cargo build --release
partpose=target/release/partpose
models=Hatchback,Sedan4Door,SUV,Hybrid
worlds=0001,0018

# Protocol "folds": what the other folds of tracks show is carved, the fold is scored.
for fold in 1 2 3 4; do
  $partpose zoo carve --dataset "$data" --worlds $worlds --models $models --fold $fold/4 \
    --out "$out/zoo-$fold" --report "$out/carve-$fold"
done
$partpose evaluate poses --dataset "$data" --worlds $worlds --fold all/4 --zoo "$out/zoo-{fold}" --oracle \
  --tables --out "$out/folds"
$partpose evaluate poses --dataset "$data" --worlds $worlds --fold all/4 --zoo "$out/zoo-{fold}" --oracle \
  --tables --degrade 84.7 --stride 3 --out "$out/folds-degraded"

# The better setting, with and without filters, errors and sizes.
better="--fit sqpnp --points-2d cm --points-3d visible --refine"
for row in "all:" "none:--filters none" "all-degraded:--degrade 84.7" "none-degraded:--filters none --degrade 84.7" \
  "none-model:--filters none --extent model" "none-model-degraded:--filters none --extent model --degrade 84.7"; do
  # shellcheck disable=SC2086
  $partpose evaluate poses --dataset "$data" --worlds $worlds --fold all/4 --zoo "$out/zoo-{fold}" --oracle \
    $better ${row#*:} --out "$out/better-${row%%:*}"
done

# Protocol "0001 to 0018": one world is carved, the other is scored.
$partpose zoo carve --dataset "$data" --worlds 0001 --models $models --out "$out/zoo-0001" --report "$out/carve-0001"
$partpose evaluate poses --dataset "$data" --worlds 0018 --zoo "$out/zoo-0001" --oracle --tables --out "$out/0001-to-0018"

$partpose evaluate pnp --problems "$problems" --out "$out/pnp"
