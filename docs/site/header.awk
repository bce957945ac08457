# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# What Doxygen reads of a header: the comment below the licence, up to "#pragma once", is the text of the file. In all comments what Doxygen would take
# for a command or for markup of its own stands as it is written: \ @ < > # & %, outside of `code`. Lines keep their numbers.
function literal(text,    out, c, i, code) {
  for (i = 1; i <= length(text); i++) {
    c = substr(text, i, 1)
    if (c == "`") code = !code
    if (!code && c ~ /[\\@<>#&%]/) out = out "\\" c
    else out = out c
  }
  return out
}
BEGIN { head = 1 }
head && /^\/\/ SPDX-/ { print "//"; next }
head && /^\/\/$/ {
  print told ? "///" : "/// \\file"
  told = 1
  next
}
head && /^\/\/ / {
  print "/// " literal(substr($0, 4))
  next
}
{ head = 0 }
match($0, /\/\/\/<? ?/) {
  print substr($0, 1, RSTART + RLENGTH - 1) literal(substr($0, RSTART + RLENGTH))
  next
}
{ print }
