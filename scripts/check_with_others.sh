#!/usr/bin/env bash
# Checks the optional formats and the server with independent programs from the Python package index: Triton's HTTP client,
# the readers of MCAP and ROS 2 messages, pyarrow, pandas and polars. CI does not need it.
#   scripts/check_with_others.sh [PARTPOSE]      PARTPOSE: a binary built with all features; else one is built
set -euo pipefail
cd "$(dirname "$0")/.."
out=target/check-others
partpose=${1:-}
if [ -z "$partpose" ]; then
  cargo build --features partpose-cli/serve,partpose-cli/mcap,partpose-cli/parquet --workspace
  partpose=target/debug/partpose
fi
[ -d "$out/venv" ] || python3 -m venv "$out/venv"
"$out/venv/bin/pip" install --quiet "tritonclient[http]" mcap mcap-ros2-support pyarrow pandas polars pillow
python="$out/venv/bin/python"

"$partpose" run examples/world/vkitti_1.3.1_rgb --camera examples/world --no-pictures --out "$out/run"
"$partpose" export --results "$out/run" --to mcap --images examples/world/vkitti_1.3.1_rgb --out "$out/mcap"
"$python" scripts/others/read_mcap.py "$out/mcap/results.mcap" "$out/run"
"$partpose" export --results "$out/run" --to parquet --out "$out/parquet"
"$python" scripts/others/read_parquet.py "$out/parquet/vehicles.parquet" "$out/run"
# What pandas has read and written is read back.
"$python" -c 'import pandas, sys; pandas.read_parquet(sys.argv[1]).to_parquet(sys.argv[2])' \
  "$out/parquet/vehicles.parquet" "$out/parquet/pandas.parquet"
"$partpose" export --from parquet --results "$out/parquet/pandas.parquet" --to parquet --out "$out/parquet/back"
"$python" scripts/others/read_parquet.py "$out/parquet/back/vehicles.parquet" "$out/run"

"$partpose" serve --port 0 --camera examples/world --queue 2 --max-body 4 2> "$out/serve.log" &
server=$!
trap 'kill "$server" 2>/dev/null || true' EXIT
for _ in $(seq 100); do grep -q listening "$out/serve.log" && break; sleep 0.2; done
address=$(sed -n 's|.*http://||p' "$out/serve.log" | head -1)
"$python" scripts/others/ask_server.py "$address" examples/world/vkitti_1.3.1_rgb "$out/run"
kill -TERM "$server"
wait "$server"
trap - EXIT
echo "the server stopped with exit code 0"
