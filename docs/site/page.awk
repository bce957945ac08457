# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# What Doxygen reads of a page: each heading has a name that says its page too, links to headings go there, pictures are found by their file's name, and
# a link to what is no page of the site (a program, a folder) is the name of that file in code. Nothing changes inside code.
#   awk -f page.awk <page>, from the project's root
function inside(path,    here) { # as from the root
  here = ENVIRON["PWD"] "/"
  return index(path, here) == 1 ? substr(path, length(here) + 1) : path
}
function joined(folder, path,    part, n, i, out) { # folder/path without "." and ".."
  if (folder != "") path = folder "/" path
  n = split(path, part, "/")
  out = ""
  for (i = 1; i <= n; i++) {
    if (part[i] == "." || part[i] == "") continue
    if (part[i] == "..") { if (!sub(/\/[^\/]*$/, "", out)) out = "" }
    else out = out == "" ? part[i] : out "/" part[i]
  }
  return out
}
function heading_name(text) {
  text = tolower(text)
  while (match(text, /\]\([^)]*\)/)) text = substr(text, 1, RSTART - 1) substr(text, RSTART + RLENGTH)
  gsub(/[^a-z0-9 _-]/, "", text)
  gsub(/ /, "-", text)
  return text
}
function page_name(path) {
  gsub(/[^A-Za-z0-9]/, "_", path)
  return path
}
function link(text, target,    at, heading, file, bang) {
  bang = text ~ /^!/
  if (target ~ /^[a-z]+:/) return text "(" target ")"
  at = index(target, "#")
  heading = at ? substr(target, at + 1) : ""
  file = at ? substr(target, 1, at - 1) : target
  file = file == "" ? page : joined(folder, file)
  if (bang) { sub(/.*\//, "", file); return text "(" file ")" }
  if (file !~ /\.md$/ || file ~ /^(examples|tests|benchmarks|weights|packaging|bindings)\//) {
    text = substr(text, 2, length(text) - 2)
    gsub(/`/, "", text)
    return text == target || text == file ? "`" file "`" : text " (`" file "`)"
  }
  return text "(#" page_name(file) (heading == "" ? "" : "_" heading) ")"
}
function literal(text,    out, i, c, code, close_at, end) {
  for (i = 1; i <= length(text); i++) {
    c = substr(text, i, 1)
    if (c == "`") { code = !code; out = out c; continue }
    if (code) { out = out c; continue }
    if (match(substr(text, i), /^!?\[[^][]*\]\([^()]*\)/)) {
      end = RLENGTH
      close_at = index(substr(text, i), "](")
      out = out link(substr(text, i, close_at), substr(text, i + close_at + 1, end - close_at - 2))
      i += end - 1
      continue
    }
    if (c ~ /[\\@#&%]/ || (c == "<" && substr(text, i + 1, 1) !~ /[a-z\/]/)) out = out "\\" c
    else out = out c
  }
  return out
}
FNR == 1 {
  page = inside(FILENAME)
  folder = page
  if (!sub(/\/[^\/]*$/, "", folder)) folder = ""
}
/^ *```/ { fenced = !fenced; print; next }
fenced { print; next }
/^#+ / {
  match($0, /^#+ /)
  marks = substr($0, 1, RLENGTH)
  text = substr($0, RLENGTH + 1)
  print marks literal(text) " {#" page_name(page) (titled ? "_" heading_name(text) : "") "}"
  titled = 1
  next
}
{ print literal($0) }
