# SPDX-License-Identifier: Apache-2.0
# The words anyone types. Each installs the packages that it needs and the machine lacks (Debian, Ubuntu), then works
# in build/; the program is build/bin/pointfair.

has_cuda := $(and $(shell command -v nvcc),$(wildcard src/cuda/CMakeLists.txt))
preset := $(if $(has_cuda),cuda,cpu)
install := scripts/install_packages.sh
jobs := $(shell nproc)
PREFIX ?= /usr/local
# every build of the targets below is faster the second time where there is ccache
ifneq ($(shell command -v ccache),)
export CMAKE_CXX_COMPILER_LAUNCHER ?= ccache
export CMAKE_CUDA_COMPILER_LAUNCHER ?= ccache
endif
FUZZ_SECONDS ?= 60
FUZZ_TARGETS = $(notdir $(wildcard build/fuzz/bin/fuzz_*))

.PHONY: help demo build test walks wheel wheels wheel-sources golden-aarch64 golden-windows golden-wheel golden-windows-wheel test-windows test-aarch64 test-archive wasm site test-site test-integrations golden bench quality bench-laz bench-viewer bench-implicit train-net paper-tables figures gallery estimates gpu release source recipes deb fuzz format docs asan tsan clean install

help:
	@echo "make build    the program, build/bin/pointfair"
	@echo "make demo     denoise an Armadillo and a real scan; errors, times and pictures in build/demo"
	@echo "make test     all tests"
	@echo "make walks    random walks through the calls of a pipeline, other ones each day (SEEDS='1 2 3')"
	@echo "make wheel    the Python package with the program, dist/*.whl"
	@echo "make wheels   wheels and archives for several systems with a pinned compiler, in dist (WHEELS='$(WHEELS)')"
	@echo "make wheel-sources  what make wheels links in, from Debian 12 into build/downloads, for another system to make the wheels"
	@echo "make golden-aarch64  the program that make wheels WHEELS='linux-x86_64 linux-aarch64' made gives the known bytes in qemu"
	@echo "make test-aarch64  the tests of the command line with that program, in qemu"
	@echo "make golden-windows  the same for the program of windows-x86_64, in wine"
	@echo "make test-windows  the tests of the command line with that program, in wine"
	@echo "make test-archive  the archive of dist for this system, unpacked: its program passes the tests of the command line"
	@echo "make golden-wheel  the wheel of dist for this system, installed alone: its module and its program give the known bytes"
	@echo "make golden-windows-wheel  the module of the wheel for Windows gives the known bytes in wine, in CPython for Windows"
	@echo "make source   the source archive with the viewer's page, in dist, from which packages are made"
	@echo "make recipes URL=...  recipes for conda-forge, vcpkg, Homebrew, Docker and Apptainer, in dist/recipes"
	@echo "make deb      Debian packages from the source archive, in dist"
	@echo "make wasm     the program as WebAssembly, which gives the known bytes in Node; the compiler comes from PyPI"
	@echo "make site     the site with the page that needs no installation, build/docs/site/app; build/docs/site is served by any host"
	@echo "make test-site  that page in Chromium: files are dropped, denoised and saved with the program's bytes, without a network"
	@echo "make test-integrations  the add-on in Blender and the provider in QGIS; installs both, 2 GB, for the Python of Debian 12"
	@echo "make golden   small clouds of all kinds give the known bytes, in every way that this processor has"
	@echo "make bench    time every stage and the peers"
	@echo "make quality  measure the noise that is left by each method and peer, into docs; some hours, goes on if stopped"
	@echo "make bench-laz  time LAZ against lazrs, which pip fetches from PyPI"
	@echo "make bench-viewer  time the viewer over its WebSocket, 100,000 and 1M points, and its page in Chromium"
	@echo "make bench-implicit mesh=FILE  time method implicit beside Eigen's solvers"
	@echo "make train-net  draw pieces and train the net of method learned for nine minutes, from where it stopped; PyTorch"
	@echo "make paper-tables  the paper's table II and figures 6 and 7 on this machine, in build/paper"
	@echo "make figures  every picture of the documents and the numbers under them, in docs"
	@echo "make gallery  run the examples in Python and scans of twelve simulated sensors, and draw them, in docs; packages from PyPI"
	@echo "make estimates  judge the program on random clouds and on cases; numpy and scipy from PyPI (ESTIMATES='--help')"
	@echo "make gpu      on a machine with a card: build, test, sanitize and benchmark, in build/gpu-report"
	@echo "make release  the program with machine code for all cards, build/release/bin/pointfair"
	@echo "make fuzz     every file reader under a fuzzer, $(FUZZ_SECONDS) s each (FUZZ_SECONDS=N)"
	@echo "make format   clang-format on every C++ file"
	@echo "make docs     the site with the references of C++ and Python, build/docs/site"
	@echo "make asan     all tests under AddressSanitizer and UndefinedBehaviorSanitizer"
	@echo "make tsan     the threaded tests under ThreadSanitizer"
	@echo "make install  library, headers and program into PREFIX=$(PREFIX)"
	@echo "make clean    removes build/"

build:
	@$(install) build
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF $(CMAKE_OPTIONS)
	cmake --build build

test:
	@$(install) build test python docs
	@scripts/fetch_laszip.sh
	cmake --preset $(preset) -DPOINTFAIR_TESTS=ON $(CMAKE_OPTIONS)
	cmake --build build
	ctest --test-dir build -j $(jobs) --output-on-failure

# random walks through the calls of a pipeline, the same steps each time for the same seeds; default: three of today
SEEDS ?= $(shell seq -s ' ' $$(date +%y%j0) $$(date +%y%j2))
walks:
	@$(install) build test
	cmake --preset $(preset) -DPOINTFAIR_TESTS=ON $(CMAKE_OPTIONS)
	cmake --build build --target pointfair_tests
	for seed in $(SEEDS); do echo "seed $$seed"; POINTFAIR_WALK_SEED=$$seed build/bin/pointfair_tests --gtest_brief=1 --gtest_filter='Walk.*' || exit 1; done

# with CUDA, machine code for all cards
wheel_build := $(if $(has_cuda),build/release,build)
wheel:
	@$(install) build python
	cmake --preset $(if $(has_cuda),release,cpu) -DPOINTFAIR_TESTS=OFF
	cmake --build $(wheel_build)
	scripts/wheel.py --build $(wheel_build) --dist dist

# not in the folder of other builds; about 20 minutes of two cores for each, the first time
WHEELS ?= linux-x86_64
wheels:
	@$(install) build
	scripts/wheels/make.py $(WHEELS) --dist dist

# only Debian 12 has them: elsewhere make wheels finds them in build/downloads
wheel-sources:
	scripts/wheels/parts.py build/downloads

# in the emulator qemu, with the C library of Debian's libc6-arm64-cross
golden-aarch64:
	@command -v qemu-aarch64-static > /dev/null && [ -d /usr/aarch64-linux-gnu ] || { echo "install qemu-user-static and libc6-arm64-cross first"; exit 1; }
	tests/golden/golden.py --runner 'qemu-aarch64-static -L /usr/aarch64-linux-gnu' --isa '' --threads 2 build/wheels/linux-aarch64/prefix/bin/pointfair

test-aarch64:
	@command -v qemu-aarch64-static > /dev/null && [ -d /usr/aarch64-linux-gnu ] || { echo "install qemu-user-static and libc6-arm64-cross first"; exit 1; }
	tests/cli/emulated.py qemu build/wheels/linux-aarch64/prefix/bin/pointfair

# in wine: one process after the other on each core, each a second and a half
golden-windows:
	@command -v wine > /dev/null || { echo "install wine first"; exit 1; }
	WINEDEBUG=-all tests/golden/golden.py --runner wine --isa '' --threads 2 build/wheels/windows-x86_64/prefix/bin/pointfair.exe

test-windows:
	@command -v wine > /dev/null || { echo "install wine first"; exit 1; }
	tests/cli/emulated.py wine build/wheels/windows-x86_64/prefix/bin/pointfair.exe

# the names of archives: linux-x86_64, linux-aarch64, macos-arm64
system := $(patsubst Linux,linux,$(patsubst Darwin,macos,$(shell uname -s)))-$(shell uname -m)
test-archive:
	rm -rf build/archive && mkdir -p build/archive
	tar -xzf dist/pointfair-*-$(system).tar.gz -C build/archive
	tests/cli/emulated.py here build/archive/*/bin/pointfair

golden-wheel:
	tests/golden/wheel.py dist

# in the CPython 3.12 that make wheels made the module with
golden-windows-wheel:
	@command -v wine > /dev/null && command -v x86_64-w64-mingw32-gcc-win32 > /dev/null || { echo "install wine and gcc-mingw-w64-x86-64-win32 first"; exit 1; }
	build/wheels/environment3.12/bin/python tests/golden/wheel_in_wine.py dist build/wheels/windows-x86_64/python3.12/windows/python3.def

wasm:
	@$(install) build python
	scripts/wheels/wasm.py program
	tests/golden/golden.py --runner $(CURDIR)/scripts/wheels/run_wasm.mjs --isa '' --threads 1 --tiles 0 build/wasm/build/bin/pointfair.wasm

site: docs
	scripts/wheels/wasm.py page
	rm -rf build/docs/site/app
	cp -r build/wasm/page build/docs/site/app

test-site:
	@$(install) build test python
	scripts/wheels/wasm.py page
	cmake --preset $(preset) -DPOINTFAIR_TESTS=ON
	cmake --build build
	ctest --test-dir build -R web.serverless --output-on-failure

# QGIS and what it needs take a gigabyte, bpy another: no other word installs them
test-integrations: wheel
	@$(install) integrations
	python3 tests/python/run.py --dist dist --work build/python/tests --integrations -rs

golden: build
	tests/golden/golden.py build/bin/pointfair

demo:
	@$(install) build demo
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF
	cmake --build build
	cmake --build build --target picture
	scripts/demo.py

# Call it until TRAIN_TOTAL seconds of training are done. Each call draws new pieces first, and writes the weights and
# their test clouds last.
TRAIN_DATA ?= build/train-net/pieces
TRAIN_STATE ?= build/train-net/state.pt
TRAIN_SECONDS ?= 540
TRAIN_TOTAL ?= 3600
train-net: build
	mkdir -p $(TRAIN_DATA)
	first=$$(($$(ls $(TRAIN_DATA) | wc -l) * 100 + 1000000)); for worker in $$(seq 0 $$(($(jobs) - 1))); do \
	  python3 training/net/pieces.py $(TRAIN_DATA) build/bin/pointfair $$(($(TRAIN_SECONDS) / 4)) $$worker $(jobs) $$first & done; wait
	python3 training/net/train.py $(TRAIN_DATA) $(TRAIN_STATE) --seconds $(TRAIN_SECONDS) --total $(TRAIN_TOTAL)
	python3 training/net/export.py $(TRAIN_STATE) src/learned/weights.bin --trust 1
	python3 training/net/golden.py src/learned/weights.bin tests/learned

bench:
	@$(install) build python bench
	cmake --preset $(preset) -B build/bench -DPOINTFAIR_TESTS=OFF -DPOINTFAIR_BENCH=ON
	cmake --build build/bench
	bench/python_peers.py --build build/bench
	bench/compare_peers.py --build build/bench

quality:
	@$(install) build python bench
	cmake --preset $(preset) -B build/bench -DPOINTFAIR_TESTS=OFF -DPOINTFAIR_BENCH=ON
	cmake --build build/bench
	bench/python_peers.py --build build/bench
	bench/quality.py --build build/bench --write docs/benchmarks.md
	bench/automatic.py --build build/bench --write docs/benchmarks.md

bench-laz:
	@$(install) build
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF
	cmake --build build --target bench_laz
	bench/laz.py

bench-implicit:
	@$(install) build bench
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF
	cmake --build build --target bench_implicit
	build/bin/bench_implicit $(mesh)

bench-viewer:
	@$(install) build
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF
	cmake --build build
	cmake --build build --target bench_viewer
	build/bin/bench_viewer --program build/bin/pointfair --points 100000
	build/bin/bench_viewer --program build/bin/pointfair --points 1000000
	@command -v chromium >/dev/null || echo "chromium was not found: the page itself is not timed"
	! command -v chromium >/dev/null || POINTFAIR_BIN=build/bin/pointfair POINTFAIR_WEB=$(CURDIR)/build/viewer/web \
	  node bench/viewer_page.mjs --points 100000

paper-tables:
	@$(install) build plots
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF
	cmake --build build
	cmake --build build --target paper_tables
	bench/paper_tables.py

figures:
	@$(install) build demo plots
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF
	cmake --build build
	cmake --build build --target picture
	scripts/figures.py
	scripts/chart.py

gallery:
	@$(install) build python demo
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF
	cmake --build build
	cmake --build build --target picture
	scripts/wheel.py --build build --dist build/python/dist
	scripts/gallery.py --dist build/python/dist
	build/gallery/bin/python scripts/sensors.py build/bin/pointfair build/bin/picture

# ESTIMATES: options of training/judge.py, as ESTIMATES='--baseline other/pointfair --clouds 5'
estimates:
	@$(install) build python
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF
	cmake --build build
	scripts/estimates.py $(ESTIMATES)

# installs nothing: such a machine may have no network
gpu:
	scripts/gpu.sh

release:
	@$(install) build
	cmake --preset release
	cmake --build build/release
	scripts/check_architectures.sh build/release/bin/pointfair

source:
	@$(install) build
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF
	cmake --build build --target pointfair_page
	packaging/make.sh source

recipes:
	packaging/make.sh recipes $(URL)

deb:
	@$(install) build deb
	packaging/make.sh deb

fuzz:
	@$(install) build test fuzz
	cmake --preset fuzz
	cmake --build build/fuzz
	! test -x build/fuzz/bin/write_seeds || build/fuzz/bin/write_seeds build/fuzz/seeds
	@$(MAKE) --no-print-directory run-fuzz

.PHONY: run-fuzz $(FUZZ_TARGETS)
run-fuzz: $(FUZZ_TARGETS)
$(FUZZ_TARGETS):
	@echo "$@: $(FUZZ_SECONDS) s"
	@mkdir -p build/fuzz/corpus/$@ build/fuzz/seeds/$@
	@build/fuzz/bin/$@ -max_total_time=$(FUZZ_SECONDS) -timeout=30 -rss_limit_mb=2048 -print_final_stats=1 \
	  -artifact_prefix=build/fuzz/ build/fuzz/corpus/$@ build/fuzz/seeds/$@ >build/fuzz/$@.log 2>&1 || { tail -40 build/fuzz/$@.log; exit 1; }
	@grep -E 'stat::(number_of_executed_units|new_units_added|peak_rss_mb)' build/fuzz/$@.log

format:
	@$(install) format
	git ls-files -z '*.cpp' '*.hpp' '*.h' '*.cu' '*.cuh' | xargs -0 clang-format-16 -i

docs:
	@$(install) build python docs
	cmake --preset $(preset)
	cmake --build build
	scripts/wheel.py --build build --dist build/python/dist
	scripts/docs.py --dist build/python/dist

asan:
	@$(install) build test
	@scripts/fetch_laszip.sh
	cmake --preset asan
	cmake --build build/asan
	ctest --test-dir build/asan -j $(jobs) --output-on-failure

# where threads meet; the rest is the same code on one thread. By default ThreadSanitizer waits a second at every exit.
tsan:
	@$(install) build test
	cmake --preset tsan
	cmake --build build/tsan
	TSAN_OPTIONS='atexit_sleep_ms=0 halt_on_error=1' ctest --test-dir build/tsan -j $(jobs) --output-on-failure -R 'Determinism|Cache|Files|interrupt|Viewer|cli.test_view'

install:
	@$(install) build
	cmake --preset $(preset) -DPOINTFAIR_TESTS=OFF
	cmake --build build
	cmake --install build --prefix $(PREFIX)

clean:
	rm -rf build
