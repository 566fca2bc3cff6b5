#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What packagers take, into dist/:
#
#   packaging/make.sh source        pointfair-VERSION.tar.gz: the sources of HEAD with the viewer's page built, and its SHA-256
#   packaging/make.sh recipes URL   recipes/: the recipes for that archive, which will lie at URL
#   packaging/make.sh deb           Debian packages, built from that archive without a network connection; their maintainer is
#                                   DEBFULLNAME with the address DEBEMAIL
set -euo pipefail
cd "$(dirname "$0")/.."
version=$(sed -n 's/.*POINTFAIR_VERSION "\(.*\)".*/\1/p' include/pointfair/version.hpp)
name=pointfair-$version
archive=$PWD/dist/$name.tar.gz

make_source() {
  local page=build/share/pointfair/web when
  [ -e $page/index.html ] || { echo "$page is missing: run make build on a machine with nodejs and npm first" >&2; exit 1; }
  [ -z "$(git status --porcelain --untracked-files=no)" ] || echo "note: the archive holds the last commit, not what was changed since" >&2
  when=$(git log -1 --format=%ct)
  mkdir -p dist
  git archive --prefix="$name/" HEAD > "dist/$name.tar"
  # the same bytes from the same commit
  tar --append --file "dist/$name.tar" --sort=name --mtime="@$when" --owner=0 --group=0 --numeric-owner --mode=u=rwX,go=rX \
    --transform "s,^$page,$name/viewer/page," $page
  gzip -9 --no-name --force "dist/$name.tar"
  (cd dist && sha256sum "$name.tar.gz" | tee "$name.tar.gz.sha256")
}

need_source() {
  [ -e "$archive" ] || { echo "$archive is missing: run make source first" >&2; exit 1; }
}

make_recipes() {
  local url=${1:?the address that the archive will have is missing: make recipes URL=https://...} sha256 sha512 recipe
  need_source
  sha256=$(sha256sum < "$archive") sha512=$(sha512sum < "$archive")
  rm -rf dist/recipes
  for recipe in conda/recipe.yaml vcpkg/vcpkg.json vcpkg/portfile.cmake vcpkg/usage homebrew/pointfair.rb docker/Dockerfile docker/pointfair.def; do
    mkdir -p "dist/recipes/${recipe%/*}"
    sed "s|@URL@|$url|g; s|@HOMEPAGE@|${url%/releases/*}|g; s|@VERSION@|$version|g; s|@SHA256@|${sha256%% *}|g; s|@SHA512@|${sha512%% *}|g" \
      "packaging/$recipe" > "dist/recipes/$recipe"
  done
  for recipe in conda docker; do cp packaging/smoke.sh dist/recipes/$recipe; done
  echo "dist/recipes: conda, vcpkg, homebrew and docker, for $url"
}

make_deb() {
  local work=build/deb maintainer="${DEBFULLNAME:-The pointfair maintainers} <${DEBEMAIL:-pointfair@localhost}>"
  need_source
  rm -rf $work && mkdir -p $work
  tar -xzf "$archive" -C $work
  cp -r packaging/debian $work/$name/debian
  sed -i "s|^Maintainer: .*|Maintainer: $maintainer|" $work/$name/debian/control
  printf 'pointfair (%s) unstable; urgency=medium\n\n  * See CHANGELOG.md.\n\n -- %s  %s\n' \
    "$version" "$maintainer" "$(date -R -d "@$(git log -1 --format=%ct)")" > $work/$name/debian/changelog
  (cd $work/$name && dpkg-buildpackage --build=binary --no-sign)
  mkdir -p dist && mv $work/*.deb dist
  ls -l dist/*.deb
}

case "${1:-}" in
  source | deb) "make_$1" ;;
  recipes) make_recipes "${2:-}" ;;
  *) sed -n '5,8s/^# *//p' "$0" >&2; exit 2 ;;
esac
