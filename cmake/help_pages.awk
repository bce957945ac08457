# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# What the tool and its commands print for --help, as a man page or as completions of a shell: -v format=man|bash|zsh|fish -v name=compmark, for man
# also -v version= and -v date=. The help of a command follows a line of a form feed and its name, the tool's own one of a form feed alone. Any awk does.

/^\f/ { finish(); command = substr($0, 2); next }
{ line[++lines] = $0 }
END {
  finish()
  if (format == "man") man()
  else if (format == "bash") bash()
  else if (format == "zsh") zsh()
  else if (format == "fish") fish()
}

# The help that was read: entries (an option, a command or an argument, with its text), headings, and what stands below them.
function finish(   i, indented, left, text) {
  column = 0
  for (i = 1; i <= lines; ++i) {
    if (i == 1) about[command] = line[1]
    else if (line[i] ~ /^  [^ ]/) {
      if (!column && match(line[i], /[^ ]  +[^ ]/)) column = RSTART + RLENGTH - 1 # that of -h,--help, which is the first
      indented = match(line[i + 1], /^ +/) ? RLENGTH : 0
      if (i < lines && indented == column - 1) {
        add("entry", trimmed(line[i]), trimmed(line[i + 1]))
        ++i
      } else add("entry", trimmed(substr(line[i], 1, column - 1)), trimmed(substr(line[i], column)))
    } else if (line[i] ~ /:$/ && line[i - 1] == "" && line[i + 1] ~ /^  [^ ]/) add("heading", substr(line[i], 1, length(line[i]) - 1), "")
    else if (line[i] != "" && line[i] !~ /^Usage:/) add("below", "", line[i])
  }
  lines = 0
}
function add(kind, left, text) {
  if (kind == "heading") heading = left
  else if (command == "" && heading == "Subcommands") {
    commands[++command_count] = left
    return
  }
  ++count[command]
  kinds[command, count[command]] = kind
  lefts[command, count[command]] = left
  texts[command, count[command]] = text
}
function trimmed(text) {
  sub(/^ +/, "", text)
  sub(/ +$/, "", text)
  return text
}

# An entry's left side, as "--views UINT:0 to 100=0 ... REQUIRED": names, type, range, choices, standard (its default), several, required, against.
function take(left) {
  against = required = several = range = choices = standard = ""
  if (match(left, / Excludes: .*$/)) {
    against = substr(left, RSTART + 11)
    left = substr(left, 1, RSTART - 1)
  }
  if (sub(/ REQUIRED$/, "", left)) required = 1
  if (sub(/ \.\.\.$/, "", left)) several = 1
  names = type = left
  sub(/ .*$/, "", names)
  if (!sub(/^[^ ]* /, "", type)) type = ""
  if (match(type, /=[^=]*$/)) {
    standard = substr(type, RSTART + 1)
    type = substr(type, 1, RSTART - 1)
  }
  if (match(type, /:.*$/)) {
    range = substr(type, RSTART + 1)
    type = substr(type, 1, RSTART - 1)
  }
  if (range ~ /^\{.*\}$/) {
    choices = substr(range, 2, length(range) - 2)
    gsub(/,/, " ", choices)
    range = ""
  }
  name_count = split(names, each_name, ",")
}
# The beginning of a text, for a menu.
function brief(text,   start) {
  start = text
  sub(/(; | \(|: ).*$/, "", start)
  return length(start) < 12 ? text : start
}
function is_option(c, i) { return kinds[c, i] == "entry" && lefts[c, i] ~ /^-/ }

function troff(text) {
  gsub(/\\/, "\\e", text)
  gsub(/-/, "\\-", text)
  gsub(/\^/, "\\(ha", text)
  gsub(/~/, "\\(ti", text)
  gsub(/`/, "\\(ga", text)
  return text
}
# The text in lines of at most 78 characters, none of which begins as a request of troff does.
function filled(text,   n, i, word, row, out) {
  n = split(troff(text), word, " ")
  row = out = ""
  for (i = 1; i <= n; ++i) {
    if (row != "" && length(row) + 1 + length(word[i]) > 78) {
      out = out row "\n"
      row = ""
    }
    row = row (row == "" ? (word[i] ~ /^[.']/ ? "\\&" : "") : " ") word[i]
  }
  return out row
}
function man_entry(left, text,   more, i, head) {
  take(left)
  head = ""
  for (i = 1; i <= name_count; ++i) head = head (i > 1 ? ", " : "") "\\fB" troff(each_name[i]) "\\fR"
  if (type != "") head = head " \\fI" type "\\fR"
  if (several) head = head " ..."
  more = required ? "; required" : ""
  if (choices != "") {
    gsub(/ /, ", ", choices)
    more = more "; one of " choices
  }
  if (range != "") more = more "; " range
  if (standard != "") more = more "; default " standard
  if (against != "") more = more "; not with " against
  print ".TP\n" head "\n" filled(text (more == "" ? "" : " [" substr(more, 3) "]"))
}
function man(   k, c, i, open) {
  print ".\\\" Written by cmake/make_help_pages.sh from what the program prints for --help."
  print ".TH " toupper(name) " 1 " date " \"" name " " version "\" \"User commands\""
  text = about[""]
  sub(/^[^:]*: /, "", text)
  print ".SH NAME\n" name " \\- " troff(text)
  print ".SH SYNOPSIS\n.B " name "\n.I COMMAND\n.RI [ OPTIONS ]\n.PP\n.B " name "\n.IR COMMAND \" \"\\c\n.B \\-\\-help"
  print ".SH OPTIONS"
  for (i = 1; i <= count[""]; ++i) if (is_option("", i)) man_entry(lefts["", i], texts["", i])
  print ".SH COMMANDS"
  for (k = 1; k <= command_count; ++k) {
    c = commands[k]
    print ".SS " troff(c) "\n" filled(toupper(substr(about[c], 1, 1)) substr(about[c], 2) ".")
    open = 0
    for (i = 1; i <= count[c]; ++i) {
      if (kinds[c, i] == "heading" && lefts[c, i] !~ /^(Options|Positionals)$/) print ".PP\n.I " troff(lefts[c, i])
      if (kinds[c, i] == "entry" && lefts[c, i] !~ /--help/) man_entry(lefts[c, i], texts[c, i])
      if (kinds[c, i] == "below") {
        if (!open) print ".PP"
        open = 1
        print filled(texts[c, i])
      }
    }
  }
  print ".SH EXIT STATUS\n0 on success, 2 after an error. Others are those of a command."
  print ".SH FILES\n.TP\n.I ../share/" name "/weights\nThe message decoder that is taken where none is named, seen from the folder\nof the program."
}

function bash(   k, c, i, n, words) {
  print "# bash completion of " name "; written by cmake/make_help_pages.sh from what the program prints for --help."
  print "_" name "() {\n  local current=$2 previous=$3 command='' words='' i"
  print "  COMPREPLY=()"
  print "  for ((i = 1; i < COMP_CWORD; ++i)); do"
  print "    if [[ ${COMP_WORDS[i]} != -* ]]; then\n      command=${COMP_WORDS[i]}\n      break\n    fi\n  done"
  print "  case \"$command $previous\" in"
  for (k = 1; k <= command_count; ++k) {
    c = commands[k]
    for (i = 1; i <= count[c]; ++i) {
      if (!is_option(c, i)) continue
      take(lefts[c, i])
      if (choices != "") print "    '" c " " names "') words='" choices "' ;;"
    }
  }
  print "    *)\n      case $command in"
  words = ""
  for (k = 1; k <= command_count; ++k) words = words " " commands[k]
  print "        '') words='" substr(words option_words(""), 2) "' ;;"
  for (k = 1; k <= command_count; ++k) print "        " commands[k] ") words='" substr(option_words(commands[k]), 2) "' ;;"
  print "      esac\n      [[ -z $command || $current == -* ]] || return\n      ;;\n  esac"
  print "  mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$current\")"
  print "}\ncomplete -o default -F _" name " " name
}
function option_words(c,   i, n, words) {
  words = ""
  for (i = 1; i <= count[c]; ++i) {
    if (!is_option(c, i)) continue
    take(lefts[c, i])
    for (n = 1; n <= name_count; ++n) words = words " " each_name[n]
  }
  return words
}

function zsh_quoted(text) {
  gsub(/'/, "'\\''", text)
  return text
}
function zsh_options(c, indent,   i, n, spec, end) {
  for (i = 1; i <= count[c]; ++i) {
    if (kinds[c, i] != "entry") continue
    take(lefts[c, i])
    text = brief(texts[c, i])
    gsub(/\\/, "\\\\&", text)
    gsub(/\[/, "\\\\&", text)
    gsub(/\]/, "\\\\&", text)
    gsub(/:/, "\\\\&", text)
    end = choices != "" ? ":" type ":(" choices ")" : type ~ /^(INT|UINT|FLOAT)$/ ? ":" type ": " : type != "" ? ":" type ":_files" : ""
    if (lefts[c, i] !~ /^-/) print indent "'1" end "' \\"
    else for (n = 1; n <= name_count; ++n) print indent "'" (several ? "*" : "") each_name[n] "[" zsh_quoted(text) "]" end "' \\"
  }
}
function zsh(   k) {
  print "#compdef " name "\n# Written by cmake/make_help_pages.sh from what the program prints for --help."
  print "_" name "() {\n  local context state state_descr line ret=1\n  typeset -A opt_args\n  local -a commands\n  commands=("
  for (k = 1; k <= command_count; ++k) {
    text = about[commands[k]]
    gsub(/\\/, "\\\\&", text)
    gsub(/:/, "\\\\&", text)
    print "    '" commands[k] ":" zsh_quoted(text) "'"
  }
  print "  )\n  _arguments -C \\"
  zsh_options("", "    ")
  print "    '1: :->command' '*:: :->option' && ret=0"
  print "  case $state in\n    command) _describe command commands && ret=0 ;;\n    option)\n      case $words[1] in"
  for (k = 1; k <= command_count; ++k) {
    print "        " commands[k] ")\n          _arguments \\"
    zsh_options(commands[k], "            ")
    print "            && ret=0\n          ;;"
  }
  print "      esac\n      ;;\n  esac\n  return ret\n}\n_" name " \"$@\""
}

function fish_quoted(text) {
  gsub(/\\/, "\\\\&", text)
  gsub(/'/, "\\'", text)
  return "'" text "'"
}
function fish_options(c, condition,   i, n, out) {
  for (i = 1; i <= count[c]; ++i) {
    if (!is_option(c, i)) continue
    take(lefts[c, i])
    out = "complete -c " name " -n " condition
    for (n = 1; n <= name_count; ++n) out = out (each_name[n] ~ /^--/ ? " -l " substr(each_name[n], 3) : " -s " substr(each_name[n], 2))
    out = out (choices != "" ? " -x -a '" choices "'" : type ~ /^(INT|UINT|FLOAT)$/ ? " -x" : type != "" ? " -r -F" : "")
    print out " -d " fish_quoted(brief(texts[c, i]))
  }
}
function fish(   k) {
  print "# fish completion of " name "; written by cmake/make_help_pages.sh from what the program prints for --help."
  for (k = 1; k <= command_count; ++k) print "complete -c " name " -n __fish_use_subcommand -f -a " commands[k] " -d " fish_quoted(about[commands[k]])
  fish_options("", "__fish_use_subcommand")
  for (k = 1; k <= command_count; ++k) fish_options(commands[k], "'__fish_seen_subcommand_from " commands[k] "'")
}
