# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The library as a Conan 2 package, from the tree that this file lies in: conan create packaging/conan --build=missing
import os
import re

from conan import ConanFile
from conan.tools.build import check_min_cppstd
from conan.tools.files import copy, load, save

required_conan_version = ">=2.0"

# compmark::app is compiled by whoever links it (cmake/CompmarkApp.cmake).
APP = """include("${CMAKE_CURRENT_LIST_DIR}/CompmarkApp.cmake")
compmark_add_app("${CMAKE_CURRENT_LIST_DIR}/../../../include/compmark/app" compmark::compmark)
"""


class CompmarkConan(ConanFile):
    name = "compmark"
    description = "Train, mark and compress anchor-based 3D Gaussian splats on the CPU"
    license = "Apache-2.0"
    topics = ("gaussian-splatting", "watermark", "compression", "header-only")
    package_type = "header-library"
    settings = "os", "arch", "compiler", "build_type"
    options = {"with_zstd": [True, False], "with_webp": [True, False]}  # SPZ 4, and WebP images of SOG files
    default_options = {"with_zstd": False, "with_webp": False}
    no_copy_source = True

    def _root(self):
        return os.path.join(self.recipe_folder, "..", "..")

    def set_version(self):
        header = load(self, os.path.join(self._root(), "include", "compmark", "version.hpp"))
        self.version = re.search(r'version = "([0-9.]+)"', header).group(1)

    def export_sources(self):
        for pattern in ("LICENSE", "include/*", "cmake/CompmarkApp.cmake"):
            copy(self, pattern, self._root(), self.export_sources_folder)

    def requirements(self):
        for needed in ("eigen/3.4.0", "nanoflann/1.4.3", "nlohmann_json/3.11.3", "stb/cci.20230920"):
            self.requires(needed, transitive_headers=True)
        if self.options.with_zstd:
            self.requires("zstd/1.5.5", transitive_headers=True, transitive_libs=True)
        if self.options.with_webp:
            self.requires("libwebp/1.3.2", transitive_headers=True, transitive_libs=True)

    def validate(self):
        check_min_cppstd(self, 20)

    def package(self):
        copy(self, "LICENSE", self.source_folder, os.path.join(self.package_folder, "licenses"))
        copy(self, "*.hpp", os.path.join(self.source_folder, "include"), os.path.join(self.package_folder, "include"))
        copy(self, "*.cpp", os.path.join(self.source_folder, "include"), os.path.join(self.package_folder, "include"))
        for header in ("stb_image.h", "stb_image_write.h"):  # Conan's stb has them in include/, the library asks for <stb/...>
            save(self, os.path.join(self.package_folder, "include", "stb", header), f"#include <{header}>\n")
        folder = os.path.join(self.package_folder, "share", "cmake", "compmark")
        copy(self, "CompmarkApp.cmake", os.path.join(self.source_folder, "cmake"), folder)
        save(self, os.path.join(folder, "compmark-app.cmake"), APP)

    def package_id(self):
        self.info.clear()

    def package_info(self):
        self.cpp_info.bindirs = []
        self.cpp_info.libdirs = []
        self.cpp_info.set_property("cmake_file_name", "compmark")
        self.cpp_info.set_property("cmake_target_name", "compmark::compmark")
        self.cpp_info.set_property("pkg_config_name", "compmark")
        self.cpp_info.set_property("cmake_build_modules", [os.path.join("share", "cmake", "compmark", "compmark-app.cmake")])
        for library in ("zstd", "webp"):
            if self.options.get_safe(f"with_{library}"):
                self.cpp_info.defines.append(f"COMPMARK_WITH_{library.upper()}")
        if self.settings.os in ("Linux", "FreeBSD"):
            self.cpp_info.system_libs = ["pthread"]
