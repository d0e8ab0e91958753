#!/usr/bin/env python3
"""Tests of check_layers.py."""
import pathlib
import tempfile
import unittest

import check_layers


class CheckLayersTest(unittest.TestCase):
    def problems(self, files):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for name, text in files.items():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_text(text)
            return list(check_layers.problems_under(root))

    def test_down_and_sideways_are_allowed(self):
        self.assertEqual([], self.problems({
            "geometry/a.cc": '#include "antipode/util/error.h"\n#include "antipode/geometry/a.h"\n',
            "cli/main.cc": "#include <antipode/report/html.h>\n"}))

    def test_up_is_refused(self):
        for include in ('#include "antipode/image/load.h"', "  #  include <antipode/pose/pose.h>"):
            problems = self.problems({"geometry/a.h": f"#pragma once\n{include}\n"})
            self.assertEqual(1, len(problems))
            self.assertIn("geometry/ must not include", problems[0])

    def test_unknown_folders_are_refused(self):
        self.assertEqual(1, len(self.problems({"extras/a.cc": ""})))
        self.assertEqual(1, len(self.problems({"util/a.cc": '#include "antipode/extras/a.h"\n'})))

    def test_other_includes_do_not_matter(self):
        self.assertEqual([], self.problems({"util/a.cc": '#include "image/load.h"\n// see antipode/cli/\n'}))


if __name__ == "__main__":
    unittest.main()
