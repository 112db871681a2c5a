//! The sentences of the desk in the shipped languages.

use std::fmt::Display;

/// A language in which the experimenter reads the desk.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Language {
    /// English.
    #[default]
    English,
    /// German.
    German,
    /// French.
    French,
    /// Spanish.
    Spanish,
    /// Japanese.
    Japanese,
    /// Chinese in simplified characters.
    Chinese,
    /// Arabic.
    Arabic,
}

impl Language {
    /// All, in the order of the sentences.
    pub const ALL: [Self; 7] = [
        Self::English,
        Self::German,
        Self::French,
        Self::Spanish,
        Self::Japanese,
        Self::Chinese,
        Self::Arabic,
    ];

    /// That of the environment, read with `var`: `STUDY_LANG`, or else what programs go by,
    /// `LC_ALL`, `LC_MESSAGES` and `LANG`. English if it is not shipped.
    pub fn of_environment(var: impl Fn(&str) -> Option<String>) -> Self {
        let names = ["STUDY_LANG", "LC_ALL", "LC_MESSAGES", "LANG"];
        let mut set = names.into_iter().filter_map(var);
        let first = set.find(|value| !value.is_empty());
        first.map_or(Self::English, |value| Self::of_tag(&value))
    }

    /// That of a locale or a language tag, such as `de_CH.UTF-8` or `de-CH`. Chinese without a script or a
    /// region that uses simplified characters may be read in traditional ones, and is English.
    fn of_tag(tag: &str) -> Self {
        let tag = tag.split(['.', '@']).next().unwrap_or_default();
        let tag = tag.replace('_', "-").to_ascii_lowercase();
        match tag.split('-').next().unwrap_or_default() {
            "de" => Self::German,
            "fr" => Self::French,
            "es" => Self::Spanish,
            "ja" => Self::Japanese,
            "ar" => Self::Arabic,
            "zh" if ["zh-cn", "zh-sg"].contains(&&*tag) || tag.starts_with("zh-hans") => {
                Self::Chinese
            }
            _ => Self::English,
        }
    }

    /// Its tag, as in `[text] lang` of a protocol.
    pub fn tag(self) -> &'static str {
        match self {
            Self::English => "en",
            Self::German => "de",
            Self::French => "fr",
            Self::Spanish => "es",
            Self::Japanese => "ja",
            Self::Chinese => "zh-Hans",
            Self::Arabic => "ar",
        }
    }

    /// Whether a study with this tag is read in the same language.
    pub fn is_of(self, lang: Option<&str>) -> bool {
        lang.map_or(Self::English, Self::of_tag) == self
    }
}

/// Declares the sentences, in the order of [`Language::ALL`].
macro_rules! sentences {
    ($($variant:ident [$english:literal, $($other:literal,)*];)*) => {
        /// A sentence of the desk. Its documentation is its English text.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Say {
            $(#[doc = $english] $variant,)*
        }

        impl Say {
            /// All sentences.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            fn texts(self) -> [&'static str; 7] {
                match self { $(Self::$variant => [$english, $($other,)*],)* }
            }
        }
    };
}

impl Say {
    /// The labels of the rows.
    pub const LABELS: [Self; 14] = [
        Self::Participant,
        Self::Trial,
        Self::Page,
        Self::Time,
        Self::Device,
        Self::Exposure,
        Self::Strokes,
        Self::Course,
        Self::Saved,
        Self::Disk,
        Self::Next,
        Self::Overdue,
        Self::Due,
        Self::Notes,
    ];

    /// The sentence in a language. Words in braces are replaced.
    pub fn get(self, language: Language) -> &'static str {
        self.texts()[language as usize]
    }

    /// The sentence with its words in braces replaced.
    pub fn fill(self, language: Language, values: &[(&str, &dyn Display)]) -> String {
        let put = |text: String, (name, value): &(&str, &dyn Display)| {
            text.replace(&format!("{{{name}}}"), &value.to_string())
        };
        values.iter().fold(self.get(language).to_owned(), put)
    }
}

sentences! {
    Participant ["Participant",
        "Person", "Participant", "Participante", "参加者", "参与者", "المشارك",];
    Trial ["Trial",
        "Durchgang", "Essai", "Ensayo", "試行", "试次", "المحاولة",];
    Page ["Page",
        "Seite", "Page", "Página", "画面", "页面", "الصفحة",];
    Time ["Time",
        "Zeit", "Temps", "Tiempo", "時間", "时间", "الوقت",];
    Device ["Device",
        "Gerät", "Appareil", "Dispositivo", "装置", "设备", "الجهاز",];
    Exposure ["Exposure",
        "Darbietung", "Exposition", "Exposición", "提示時間", "呈现", "مدة العرض",];
    Strokes ["Strokes",
        "Hübe", "Courses", "Recorridos", "ストローク", "行程", "الأشواط",];
    Course ["Course",
        "Verlauf", "Déroulement", "Transcurso", "経過", "进程", "المسار",];
    Saved ["Saved",
        "Gesichert", "Enregistré", "Guardado", "保存", "已保存", "المحفوظ",];
    Disk ["Disk",
        "Datenträger", "Disque", "Disco", "ディスク", "磁盘", "القرص",];
    Next ["Next",
        "Als Nächste", "Ensuite", "Después", "次の参加者", "下一位", "التالي",];
    Overdue ["Overdue",
        "Überfällig", "En retard", "Atrasadas", "期限切れ", "逾期", "المتأخرون",];
    Due ["Due",
        "Fällig", "Attendus", "Pendientes", "予定", "到期", "المستحقون",];
    Notes ["Notes",
        "Notizen", "Notes", "Notas", "メモ", "备注", "الملاحظات",];
    Session ["session {n}",
        "Sitzung {n}", "séance {n}", "sesión {n}", "セッション {n}", "第 {n} 次会话", "الجلسة {n}",];
    Part ["part {n} of {total}",
        "Teil {n} von {total}", "partie {n} sur {total}", "parte {n} de {total}", "パート {n}／{total}", "第 {n} 部分，共 {total} 部分", "الجزء {n} من {total}",];
    SoFar ["{time} so far",
        "bisher {time}", "{time} écoulé", "{time} transcurrido", "経過 {time}", "已用 {time}", "مضى {time}",];
    Left ["about {n} min left",
        "noch etwa {n} min", "encore {n} min environ", "quedan unos {n} min", "残り約 {n} 分", "约剩 {n} 分钟", "بقي نحو {n} دقيقة",];
    LeftUnknown ["time left not known yet",
        "Restzeit noch unbekannt", "temps restant pas encore connu", "tiempo restante aún desconocido", "残り時間はまだ不明", "剩余时间尚不清楚", "الوقت المتبقي غير معروف بعد",];
    Consents ["decides whether to take part",
        "entscheidet über die Teilnahme", "décide de sa participation", "decide si participa", "参加するか決めている", "正在决定是否参加", "يقرر المشاركة",];
    Reads ["reads",
        "liest", "lit", "lee", "読んでいる", "正在阅读", "يقرأ",];
    Before ["before the next trial",
        "vor dem nächsten Durchgang", "avant l’essai suivant", "antes del siguiente ensayo", "次の試行の前", "下一试次之前", "قبل المحاولة التالية",];
    Answers ["answers",
        "antwortet", "répond", "responde", "回答中", "正在回答", "يجيب",];
    Feels ["feels",
        "fühlt", "explore", "explora", "体験中", "正在感受", "يتحسس",];
    Waits ["waits for the device",
        "wartet auf das Gerät", "attend l’appareil", "espera al dispositivo", "装置を待っている", "等待设备", "ينتظر الجهاز",];
    Stopped ["stopped",
        "angehalten", "arrêté", "detenido", "停止中", "已停止", "متوقف",];
    Rests ["rests",
        "macht Pause", "se repose", "descansa", "休憩中", "正在休息", "يستريح",];
    Saves ["waits until everything is saved",
        "wartet, bis alles gesichert ist", "attend l’enregistrement", "espera a que todo se guarde", "保存を待っている", "等待保存完成", "ينتظر الحفظ",];
    NoSession ["no session yet",
        "noch keine Sitzung", "pas encore de séance", "aún no hay sesión", "セッション前", "尚无会话", "لا جلسة بعد",];
    Limp ["no force",
        "kraftlos", "sans force", "sin fuerza", "力なし", "无力", "بلا قوة",];
    Loading ["loading",
        "lädt", "chargement", "cargando", "読み込み中", "正在加载", "يُحمَّل",];
    DeviceReady ["ready",
        "bereit", "prêt", "listo", "準備完了", "就绪", "جاهز",];
    Running ["running",
        "läuft", "en marche", "en marcha", "動作中", "运行中", "يعمل",];
    Reports ["running · telemetry arrives",
        "läuft · Messwerte kommen an", "en marche · la télémétrie arrive", "en marcha · llega la telemetría", "動作中 · 計測値を受信", "运行中 · 正在接收遥测", "يعمل · القياسات تصل",];
    Silent ["running · NO TELEMETRY",
        "läuft · KEINE MESSWERTE", "en marche · PAS DE TÉLÉMÉTRIE", "en marcha · SIN TELEMETRÍA", "動作中 · 計測値なし", "运行中 · 无遥测", "يعمل · لا قياسات",];
    Stopping ["stopping",
        "hält an", "s’arrête", "deteniéndose", "停止動作中", "正在停止", "يتوقف",];
    Fault ["FAULT",
        "FEHLER", "PANNE", "FALLO", "故障", "故障", "عطل",];
    Lost ["LOST",
        "NICHT ERREICHBAR", "INJOIGNABLE", "SIN CONEXIÓN", "応答なし", "失去连接", "مفقود",];
    ByHand ["samples by hand",
        "Proben von Hand", "échantillons à la main", "muestras a mano", "手動の試料", "手动样品", "عينات يدوية",];
    Felt ["a sample is felt",
        "eine Probe wird gefühlt", "un échantillon est exploré", "se explora una muestra", "試料を体験中", "正在感受样品", "تُتحسَّس عينة",];
    AtLeast ["at least {time}",
        "mindestens {time}", "au moins {time}", "al menos {time}", "{time} 以上", "至少 {time}", "على الأقل {time}",];
    AtMost ["at most {time}",
        "höchstens {time}", "au plus {time}", "como máximo {time}", "{time} まで", "最多 {time}", "على الأكثر {time}",];
    Required ["at least {n}",
        "mindestens {n}", "au moins {n}", "al menos {n}", "{n} 回以上", "至少 {n} 次", "على الأقل {n}",];
    NotRequired ["none required",
        "keine verlangt", "aucune exigée", "ninguno exigido", "指定なし", "无要求", "غير مطلوبة",];
    Enough ["enough",
        "genug", "suffisant", "suficiente", "十分", "已足够", "كافٍ",];
    More ["more needed",
        "noch nicht genug", "pas encore assez", "falta más", "まだ不足", "尚不够", "يلزم المزيد",];
    InStep ["mirror in step",
        "Spiegel auf Stand", "miroir à jour", "espejo al día", "ミラーは最新", "镜像同步", "المرآة محدَّثة",];
    OnlyResults ["MIRROR LEFT BEHIND",
        "SPIEGEL ZURÜCKGEBLIEBEN", "MIROIR EN RETARD", "ESPEJO ATRASADO", "ミラーが遅れている", "镜像落后", "المرآة متأخرة",];
    OnlyMirror ["ONLY IN THE MIRROR",
        "NUR IM SPIEGEL", "SEULEMENT DANS LE MIROIR", "SOLO EN EL ESPEJO", "ミラーのみ", "仅在镜像中", "في المرآة فقط",];
    NoMirror ["no mirror",
        "kein Spiegel", "pas de miroir", "sin espejo", "ミラーなし", "无镜像", "لا مرآة",];
    Free ["{size} free",
        "{size} frei", "{size} libres", "{size} libres", "空き {size}", "剩余 {size}", "{size} متاحة",];
    AlmostFull ["ALMOST FULL: {size} free",
        "FAST VOLL: {size} frei", "PRESQUE PLEIN : {size} libres", "CASI LLENO: {size} libres", "残りわずか：空き {size}", "空间不足：剩余 {size}", "شبه ممتلئ: {size} متاحة",];
    Nobody ["nobody",
        "niemand", "personne", "nadie", "なし", "无", "لا أحد",];
    Legend ["█ feels  ▄ answers  ░ device  · reads  ─ rests  ! fault",
        "█ fühlt  ▄ antwortet  ░ Gerät  · liest  ─ Pause  ! Fehler", "█ explore  ▄ répond  ░ appareil  · lit  ─ repos  ! panne", "█ explora  ▄ responde  ░ equipo  · lee  ─ pausa  ! fallo", "█ 体験  ▄ 回答  ░ 装置  · 読む  ─ 休憩  ! 故障", "█ 感受  ▄ 回答  ░ 设备  · 阅读  ─ 休息  ! 故障", "█ يتحسس  ▄ يجيب  ░ الجهاز  · يقرأ  ─ راحة  ! عطل",];
    PageKey ["participant’s page",
        "Seite der Person", "page du participant", "página del participante", "参加者の画面", "参与者页面", "صفحة المشارك",];
    DeskKey ["desk",
        "Pult", "pupitre", "puesto", "操作卓", "控制台", "المكتب",];
    PauseKey ["pause",
        "Pause", "pause", "pausa", "一時停止", "暂停", "توقف",];
    NotHere ["F9 shows the participant’s page, on which these keys act.",
        "F9 zeigt die Seite der Person, auf der diese Tasten wirken.", "F9 montre la page du participant, où ces touches agissent.", "F9 muestra la página del participante, donde actúan estas teclas.", "F9 で参加者の画面を表示すると、このキーが使えます。", "按 F9 显示参与者页面，这些键在那里有效。", "يعرض F9 صفحة المشارك التي تعمل فيها هذه المفاتيح.",];
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::desk::Doing;
    use crate::tui::wrap::width;
    use study_plan::protocol::phrases::{is_shipped, languages, placeholders};

    #[test]
    fn the_languages_are_those_of_the_participants_sentences() {
        let shipped: Vec<&str> = languages().collect();
        assert_eq!(Language::ALL.map(Language::tag).to_vec(), shipped);
        for (n, language) in Language::ALL.into_iter().enumerate() {
            assert_eq!(language as usize, n);
            assert!(is_shipped(language.tag()) && language.is_of(Some(language.tag())));
        }
    }

    #[test]
    fn every_language_has_every_sentence_with_the_same_placeholders() {
        for say in Say::ALL {
            let english = placeholders(say.get(Language::English));
            for language in Language::ALL {
                let text = say.get(language);
                assert!(!text.trim().is_empty(), "{say:?} in {language:?}");
                assert_eq!(placeholders(text), english, "{say:?} in {language:?}");
            }
        }
    }

    #[test]
    fn labels_and_legend_leave_room_in_sixty_columns() {
        let kinds = [
            Doing::Reads,
            Doing::Rests,
            Doing::Waits,
            Doing::Answers,
            Doing::Feels,
            Doing::Trouble,
        ];
        for language in Language::ALL {
            for label in Say::LABELS {
                assert!(
                    width(label.get(language)) <= 13,
                    "{label:?} in {language:?}"
                );
            }
            let legend = Say::Legend.get(language);
            assert!(width(legend) <= 58, "{language:?}");
            for kind in kinds {
                assert!(legend.contains(kind.symbol()), "{kind:?} in {language:?}");
            }
        }
    }

    #[test]
    fn the_environment_says_which_language() {
        let of = |vars: &[(&str, &str)]| {
            Language::of_environment(|name| {
                let found = vars.iter().find(|(n, _)| *n == name);
                found.map(|(_, value)| (*value).to_owned())
            })
        };
        assert_eq!(of(&[]), Language::English);
        assert_eq!(of(&[("LANG", "C.UTF-8")]), Language::English);
        assert_eq!(of(&[("LANG", "de_CH.UTF-8")]), Language::German);
        assert_eq!(
            of(&[("LC_ALL", ""), ("LANG", "ja_JP.eucJP")]),
            Language::Japanese
        );
        assert_eq!(
            of(&[("LC_ALL", "fr_FR@euro"), ("LANG", "de")]),
            Language::French
        );
        assert_eq!(
            of(&[("STUDY_LANG", "ar"), ("LC_ALL", "de")]),
            Language::Arabic
        );
        assert_eq!(of(&[("LANG", "zh_CN.UTF-8")]), Language::Chinese);
        assert_eq!(of(&[("LANG", "zh_TW.UTF-8")]), Language::English);
        assert!(Language::English.is_of(None) && !Language::German.is_of(None));
    }
}
