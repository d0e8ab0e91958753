# make setup   what the build needs: system packages, and LibTorch in .venv
# make build   build/release/bin/antipode and its tests
# make test    everything a developer needs: unit, golden, package and sanitizer tests
# make demo    a pose on the pictures in demo/
# make format  clang-format over the sources
# make clean   removes build/

.DELETE_ON_ERROR:
.PHONY: all setup build test demo format clean

all: build

setup:
	@scripts/setup.sh

build: setup
	cmake --preset release
	cmake --build --preset release

test: build
	cmake --preset sanitize
	cmake --build --preset sanitize
	ctest --preset sanitize
	ctest --preset release --output-on-failure -j2

demo: build
	scripts/demo.sh

format:
	find src tests bench -name '*.h' -o -name '*.cc' | xargs clang-format -i

clean:
	rm -rf build
