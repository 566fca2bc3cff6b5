# SPDX-License-Identifier: Apache-2.0
class Pointfair < Formula
  desc "Removes the noise of 3D scans and keeps their shape"
  homepage "@HOMEPAGE@"
  url "@URL@"
  sha256 "@SHA256@"
  license "Apache-2.0"

  depends_on "boost" => :build
  depends_on "cli11" => :build
  depends_on "cmake" => :build
  depends_on "fast_float" => :build
  depends_on "nanoflann" => :build
  depends_on "ninja" => :build
  depends_on "nlohmann-json" => :build
  depends_on "fmt"
  depends_on "pugixml"
  depends_on "tbb"

  def install
    args = %w[-DPOINTFAIR_CUDA=OFF -DPOINTFAIR_TESTS=OFF]
    system "cmake", "-S", ".", "-B", "build", "-G", "Ninja", *args, *std_cmake_args
    system "cmake", "--build", "build"
    system "cmake", "--install", "build"
    pkgshare.install "packaging/smoke.sh"
  end

  test do
    system "sh", pkgshare/"smoke.sh", bin/"pointfair"
  end
end
