#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Checks the CUDA code in a program or library: machine code for every architecture of a release, PTX for cards to come,
# and no predicated REDUX, which ptxas of CUDA 13.0 gets wrong (src/cuda/runtime/warp.cuh). Needs cuobjdump and nvdisasm, no card.
#
#   scripts/check_architectures.sh FILE [ARCHITECTURES]     default: those of the preset `release`
set -euo pipefail
file=${1:?usage: $0 FILE [ARCHITECTURES]}
root=$(cd "$(dirname "$0")/.." && pwd)
architectures=${2:-$(grep -oP 'POINTFAIR_CUDA_ARCHITECTURES": "\K[^"]+' "$root/CMakePresets.json")}
failed=0
complain() {
  echo "$1"
  failed=1
}

for tool in cuobjdump nvdisasm; do
  command -v $tool >/dev/null || { echo "$file is built but not checked: $tool was not found, which comes with the CUDA toolkit"; exit 2; }
done
machine_code=$(cuobjdump --list-elf "$file" | grep -oE 'sm_[0-9]+' | sort -Vu | tr '\n' ' ')
ptx=$(cuobjdump --list-ptx "$file" | grep -oE 'sm_[0-9]+' | sort -Vu | tr '\n' ' ')
echo "machine code: ${machine_code:-none}"
echo "PTX: ${ptx:-none}"
for architecture in ${architectures//;/ }; do
  number=${architecture%%-*}
  case "$architecture" in *-virtual) ;; *) [[ " $machine_code" == *" sm_$number "* ]] || complain "no machine code for sm_$number" ;; esac
  case "$architecture" in *-real) ;; *) [[ " $ptx" == *" sm_$number "* ]] || complain "no PTX for $number" ;; esac
done
for architecture in $machine_code; do
  code=$(cuobjdump --dump-sass --gpu-architecture "$architecture" "$file")
  wrong=$(grep -cE '@.*REDUX' <<<"$code" || true)
  echo "$architecture: $(grep -cE '^[[:space:]]*Function' <<<"$code") kernels, $(grep -c REDUX <<<"$code" || true) REDUX, $wrong of them predicated"
  [ "$wrong" = 0 ] || complain "$architecture: predicated REDUX; see src/cuda/runtime/warp.cuh"
done
exit $failed
